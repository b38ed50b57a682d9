#include "engine/jobs/durable_file.h"

#include <gtest/gtest.h>

#include "tests/engine/jobs/jobs_support.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;

std::size_t entries(const fs::path& folder) {
  return std::size_t(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(DurableFile, IsReadAsItWasWritten) {
  const support::TempDir dir;
  const fs::path folder = dir.path() / "a" / "b";
  value(create_folder(folder));
  value(create_folder(folder));
  const std::string bytes("zero\0inside\n", 12);
  value(write_durably(folder / "file", "older and longer than what follows"));
  value(write_durably(folder / "file", bytes));
  EXPECT_EQ(value(read_bytes(folder / "file")), bytes);
  EXPECT_EQ(entries(folder), 1u) << "a temporary file was left";
}

TEST(DurableFile, KeepsItsOldBytesWhenTheDiskIsFull) {
  const support::TempDir dir;
  const fs::path file = dir.path() / "file";
  value(write_durably(file, "old"));
  {
    const FullDisk full(1000);
    const auto written = write_durably(file, std::string(5000, 'x'));
    ASSERT_EQ(code_of(written), ErrorCode::no_space);
    EXPECT_EQ(written.error().where, file.string());
  }
  EXPECT_EQ(value(read_bytes(file)), "old");
  EXPECT_EQ(entries(dir.path()), 1u) << "half a file takes space";
  value(write_durably(file, "new"));
  EXPECT_EQ(value(read_bytes(file)), "new");
}

TEST(DurableFile, NamesWhatIsMissingOrInTheWay) {
  const support::TempDir dir;
  EXPECT_EQ(code_of(read_bytes(dir.path() / "absent")), ErrorCode::not_found);
  EXPECT_EQ(code_of(write_durably(dir.path() / "absent" / "file", "x")), ErrorCode::unavailable);
  support::write_file(dir.path() / "file", "x");
  const auto made = create_folder(dir.path() / "file" / "below");
  ASSERT_EQ(code_of(made), ErrorCode::unavailable);
  EXPECT_EQ(made.error().where, (dir.path() / "file").string());
}

}  // namespace
}  // namespace engine::jobs
