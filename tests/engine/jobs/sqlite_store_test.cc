#include "engine/jobs/sqlite_store.h"

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "engine/core/byte_writer.h"
#include "engine/core/checksum.h"
#include "tests/engine/jobs/jobs_support.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr std::size_t many = 1000;

/// Makes tables as they were before they knew who asks and who works.
const std::string without_people =
    "DROP TABLE worked; ALTER TABLE jobs DROP COLUMN requester; ALTER TABLE jobs DROP COLUMN worked; ALTER TABLE jobs "
    "DROP COLUMN holder; ALTER TABLE jobs DROP COLUMN claimed_at; ";

/// What the checksum of a row is: FNV-1a over its values, each with its type, texts with their length, too.
void checksum(sqlite3_context* context, int count, sqlite3_value** values) {
  ByteWriter all;
  for (int i = 0; i < count; ++i) {
    all.write(std::int32_t(sqlite3_value_type(values[i])));
    if (sqlite3_value_type(values[i]) == SQLITE_INTEGER) all.write(std::int64_t(sqlite3_value_int64(values[i])));
    if (sqlite3_value_type(values[i]) == SQLITE_TEXT) {
      const std::span text(static_cast<const std::byte*>(sqlite3_value_blob(values[i])),
                           std::size_t(sqlite3_value_bytes(values[i])));
      all.write(std::uint64_t(text.size()));
      all.write_all(text);
    }
  }
  sqlite3_result_int64(context, std::int64_t(fnv1a(all.bytes())));
}

class SqliteStoreTest : public testing::Test {
 protected:
  std::string submit() { return value(store->submit({.lane = "a", .payload = "{}"}, many)).job.id; }
  std::string claim() {
    const auto job = value(store->claim());
    return job ? job->id : "";
  }
  void reopen() {
    store.reset();
    store = open_store(dir.path());
  }
  void execute(const std::string& sql) {
    store.reset();
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
    sqlite3_create_function(database, "row_checksum", -1, SQLITE_UTF8, nullptr, checksum, nullptr, nullptr);
    EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
    sqlite3_close(database);
  }

  support::TempDir dir;
  fs::path file = dir.path() / "jobs.db";
  std::unique_ptr<SqliteStore> store = open_store(dir.path());
};

TEST_F(SqliteStoreTest, IsHeldByOneAtATime) {
  const auto second = SqliteStore::open({.folder = dir.path(), .busy_timeout = 10ms});
  ASSERT_EQ(code_of(second), ErrorCode::unavailable);
  EXPECT_EQ(second.error().where, file.string());
  submit();
  reopen();
}

TEST_F(SqliteStoreTest, SurvivesAFullDisk) {
  submit();
  {
    const FullDisk full(fs::file_size(dir.path() / "jobs.db-wal"));
    const auto refused = store->submit({.lane = "a", .payload = std::string(100'000, 'x')}, many);
    ASSERT_EQ(code_of(refused), ErrorCode::no_space);
    EXPECT_EQ(refused.error().where, file.string());
    EXPECT_EQ(code_of(store->claim()), ErrorCode::no_space);
    EXPECT_EQ(value(store->find("e000001")).state, JobState::queued) << "reading needs no space";
    EXPECT_EQ(value(store->list({})).size(), 1u);
  }
  EXPECT_EQ(submit(), "e000002") << "what was refused has left no trace";
  EXPECT_EQ(claim(), "e000001");
  reopen();
  EXPECT_EQ(value(store->list({})).size(), 2u);
}

TEST_F(SqliteStoreTest, RefusesAFileThatIsNoJobStore) {
  store.reset();
  support::write_file(file, std::string(8192, 'x'));
  const auto garbage = SqliteStore::open({.folder = dir.path()});
  ASSERT_EQ(code_of(garbage), ErrorCode::corrupt_data);
  EXPECT_EQ(garbage.error().where, file.string());
  fs::remove(file);
  execute("CREATE TABLE recipes (name TEXT)");
  EXPECT_EQ(code_of(SqliteStore::open({.folder = dir.path()})), ErrorCode::corrupt_data);
}

TEST_F(SqliteStoreTest, ReadsAFileOfTheVersionBefore) {
  submit();
  claim();
  value(store->apply("e000001", {.event = Event::finish_interval, .claim = 1, .progress = "half", .interval = 2}));
  execute(without_people +
          "ALTER TABLE jobs DROP COLUMN claim_number; ALTER TABLE jobs DROP COLUMN place; ALTER TABLE jobs DROP COLUMN "
          "died_at; ALTER TABLE jobs DROP COLUMN deaths; "
          "ALTER TABLE jobs DROP COLUMN checksum; ALTER TABLE jobs DROP COLUMN expected; "
          "PRAGMA user_version = 1");
  store = open_store(dir.path());
  const Job job = value(store->find("e000001"));
  EXPECT_EQ(job.finished_intervals, 2);
  EXPECT_EQ(job.progress, "half");
  EXPECT_EQ(job.deaths, 1) << "the process that held it is gone";
  EXPECT_EQ(claim(), "e000001");
  reopen();
  EXPECT_EQ(value(store->find("e000001")).deaths, 2);
}

TEST_F(SqliteStoreTest, ReadsAFileWithoutClaimNumbersAndHoldsItsRowsAgainstTheirChecksums) {
  const std::string version_4 =
      "PRAGMA user_version = 4; UPDATE jobs SET checksum = row_checksum(number, lane, payload, idempotency_key, state, "
      "claimed, stopped_early, finished_intervals, progress, result, error_code, error_message, error_where, created, "
      "started, ended, place, died_at, deaths, expected)";
  submit();
  claim();
  execute(without_people + "ALTER TABLE jobs DROP COLUMN claim_number; " + version_4);
  reopen();
  EXPECT_EQ(value(store->claim())->claim_number, 1) << "they begin anew: whoever held the job is gone";
  execute(without_people + "ALTER TABLE jobs DROP COLUMN claim_number; " + version_4 + "; UPDATE jobs SET lane = 'b'");
  const auto damaged = SqliteStore::open({.folder = dir.path()});
  ASSERT_EQ(code_of(damaged), ErrorCode::corrupt_data);
  EXPECT_NE(damaged.error().message.find("e000001"), std::string::npos) << damaged.error().message;
}

TEST_F(SqliteStoreTest, RefusesAFileOfANewerVersion) {
  execute("PRAGMA user_version = 7");
  EXPECT_EQ(code_of(SqliteStore::open({.folder = dir.path()})), ErrorCode::unsupported);
}

TEST_F(SqliteStoreTest, NamesARecordThatMakesNoSense) {
  submit();
  execute("UPDATE jobs SET lane = 'b'");  // nothing that SQLite would mind
  const auto opened = SqliteStore::open({.folder = dir.path()});
  ASSERT_EQ(code_of(opened), ErrorCode::corrupt_data);
  EXPECT_NE(opened.error().message.find("e000001"), std::string::npos) << opened.error().message;
}

TEST_F(SqliteStoreTest, NamesDamageWhereverItIs) {
  for (int i = 0; i < 80; ++i) submit();
  store.reset();
  const std::string whole = support::read_file(file);
  int noticed = 0;
  const auto try_with = [&](const std::string& bytes) {
    support::write_file(file, bytes);
    const auto opened = SqliteStore::open({.folder = dir.path()});
    const auto listed = opened ? (*opened)->list({}) : propagate(opened);
    if (listed) return;  // it hit a payload, or space that is not used
    ++noticed;
    EXPECT_EQ(listed.error().code, ErrorCode::corrupt_data) << listed.error().message;
    EXPECT_EQ(listed.error().where, file.string());
  };
  for (std::size_t at = 100; at + 64 < whole.size(); at += 480) {
    SCOPED_TRACE(at);
    std::string damaged = whole;
    damaged.replace(at, 64, 64, '\xa5');
    try_with(damaged);
  }
  EXPECT_GT(noticed, 5);
  noticed = 0;
  for (std::size_t size = 4096; size < whole.size(); size += 4096) try_with(whole.substr(0, size));
  EXPECT_EQ(noticed, int(whole.size() / 4096 - 1)) << "a file that was cut is always noticed";
}

}  // namespace
}  // namespace engine::jobs
