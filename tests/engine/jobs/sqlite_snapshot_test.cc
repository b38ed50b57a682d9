#include "engine/jobs/sqlite_snapshot.h"

#include <thread>

#include "tests/engine/jobs/jobs_support.h"
#include "tests/support/child.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

class SqliteSnapshotTest : public testing::Test {
 protected:
  /// A copy of the store as it is now, opened.
  std::unique_ptr<SqliteStore> copy() {
    const fs::path to = dir.path() / ("copy" + std::to_string(copies++));
    fs::create_directory(to);
    value(copy_sqlite_store(from, to));
    return value(SqliteStore::open({.folder = to, .visits = true}));
  }

  support::TempDir dir;
  const fs::path from = dir.path() / "store";
  int copies = 0;
};

TEST_F(SqliteSnapshotTest, IsWholeAtAnyMomentWhileAnotherProcessWrites) {
  const support::Child writer([&](const support::Child&) {
    const auto store = open_store(from);
    // Long texts fill the log again and again, so that it begins anew meanwhile.
    for (int i = 0;; ++i) {
      const auto job =
          value(store->submit({.lane = std::to_string(i), .payload = std::string(30'000, 'x')}, 1'000'000));
      value(store->apply(job.job.id, {.event = Event::cancel}));
      if (i % 3 == 0) value(store->remove(job.job.id));
    }
  });
  while (!fs::exists(from / "jobs.db-wal") || fs::file_size(from / "jobs.db-wal") < 100'000)
    std::this_thread::sleep_for(1ms);
  std::size_t seen = 0;
  for (int i = 0; i < 20; ++i) {
    const auto store = copy();  // which checks every row and index
    const auto jobs = value(store->list({.limit = 1'000'000}));
    EXPECT_GE(jobs.size(), seen) << "time goes on";
    seen = jobs.size();
    EXPECT_EQ(is_sqlite_store_in_use(from), true);
    std::this_thread::sleep_for(20ms);
  }
  EXPECT_GT(seen, 5u);
  writer.kill();
  EXPECT_FALSE(writer.ended_well()) << "it would have gone on";
}

TEST_F(SqliteSnapshotTest, ShowsClaimsAndLeavesTheStoreAsItIs) {
  {
    const auto store = value(SqliteStore::open({.folder = from, .holder = "host:1"}));
    value(store->submit({.lane = "a", .payload = "x"}, 10));
    (void)value(store->claim());
  }
  EXPECT_EQ(is_sqlite_store_in_use(from), false);
  const auto before = support::read_file(from / "jobs.db");
  EXPECT_EQ(value(copy()->find("e000001")).holder, "host:1");
  EXPECT_TRUE(value(copy()->find("e000001")).claimed);
  EXPECT_EQ(support::read_file(from / "jobs.db"), before);
}

TEST_F(SqliteSnapshotTest, MissesAStoreThatIsNotThere) {
  fs::create_directory(from);
  EXPECT_EQ(code_of(copy_sqlite_store(from, dir.path())), ErrorCode::not_found);
  EXPECT_EQ(is_sqlite_store_in_use(from), false);
  fs::create_symlink("jobs.db", from / "jobs.db");  // which cannot be opened
  EXPECT_EQ(is_sqlite_store_in_use(from), std::nullopt);
}

}  // namespace
}  // namespace engine::jobs
