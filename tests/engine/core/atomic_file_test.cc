#include "engine/core/atomic_file.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <string>

#include "tests/support/data.h"
#include "tests/support/full_disk.h"

namespace engine {
namespace {

std::span<const std::byte> as_span(const std::string& bytes) { return std::as_bytes(std::span(bytes)); }

std::size_t files_in(const std::filesystem::path& folder) {
  return std::size_t(std::distance(std::filesystem::directory_iterator(folder), {}));
}

TEST(AtomicFile, AppearsOnlyWhenCommitted) {
  const support::TempDir folder;
  const auto path = folder.path() / "scene.ply";
  support::write_file(path, "old");
  auto file = AtomicFile::create(path);
  ASSERT_TRUE(file);
  ASSERT_TRUE(file->write(as_span("new bytes")));
  EXPECT_EQ(support::read_file(path), "old");
  ASSERT_TRUE(file->commit());
  EXPECT_EQ(support::read_file(path), "new bytes");
  EXPECT_EQ(files_in(folder.path()), 1u);
}

TEST(AtomicFile, LeavesNothingBehindWhenAbandoned) {
  const support::TempDir folder;
  {
    auto file = AtomicFile::create(folder.path() / "scene.ply");
    ASSERT_TRUE(file);
    ASSERT_TRUE(file->write(as_span("half a sc")));
    const AtomicFile moved = std::move(*file);  // the one that was moved from must not remove anything either
    EXPECT_EQ(files_in(folder.path()), 1u);
  }
  EXPECT_EQ(files_in(folder.path()), 0u);
}

TEST(AtomicFile, TwoWritersOfOnePathDoNotDisturbEachOther) {
  const support::TempDir folder;
  const auto path = folder.path() / "scene.ply";
  auto a = AtomicFile::create(path), b = AtomicFile::create(path);
  ASSERT_TRUE(a && b);
  ASSERT_TRUE(a->write(as_span("aaa")) && b->write(as_span("b")));
  ASSERT_TRUE(a->commit() && b->commit());
  EXPECT_EQ(support::read_file(path), "b");
}

TEST(AtomicFile, NamesAFolderThatIsNotThereAndAPathThatIsAFolder) {
  const support::TempDir folder;
  const auto missing = write_file(folder.path() / "no" / "scene.ply", {});
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::not_found);
  EXPECT_NE(missing.error().message.find("no/scene.ply"), std::string::npos);
  const auto is_folder = write_file(folder.path(), {});
  ASSERT_FALSE(is_folder);
  EXPECT_EQ(is_folder.error().code, ErrorCode::invalid_argument);
}

TEST(AtomicFile, AWriteThatFailsHalfWayKeepsTheOldFileAndNamesThePath) {
  const support::TempDir folder;
  const auto path = folder.path() / "scene.ply";
  support::write_file(path, "old");
  Result<void> written;
  {
    const support::FullDisk full(1000);
    written = write_file(path, as_span(std::string(5000, 'x')));
  }
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::no_space);
  EXPECT_EQ(written.error().where, path.string());
  EXPECT_EQ(support::read_file(path), "old");
  EXPECT_EQ(files_in(folder.path()), 1u);
}

TEST(AtomicFile, SaysWhatWentWrongInTheWordsItWasGiven) {
  const support::TempDir folder;
  const auto path = folder.path() / "no" / "scene.ply";
  const auto written = write_file(path, {}, [](int number, const std::string& action, const std::filesystem::path& at) {
    return Error{ErrorCode::busy, action + " " + std::to_string(number), at.string()};
  });
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::busy);
  EXPECT_EQ(written.error().message, "write " + std::to_string(ENOENT));
  EXPECT_EQ(written.error().where, path.string());
}

TEST(MeansNoSpace, CountsQuotasAndLimitsAsAFullDisk) {
  for (const int number : {ENOSPC, EDQUOT, EFBIG}) EXPECT_TRUE(means_no_space(number)) << number;
  EXPECT_FALSE(means_no_space(EACCES));
}

TEST(FileError, TellsAFullDiskFromOtherTrouble) {
  EXPECT_EQ(file_error(ENOSPC, "write", "/data/s.ply").code, ErrorCode::no_space);
  EXPECT_EQ(file_error(EDQUOT, "write", "/data/s.ply").code, ErrorCode::no_space);
  EXPECT_EQ(file_error(EACCES, "write", "/data/s.ply").code, ErrorCode::unavailable);
  EXPECT_EQ(file_error(EIO, "write", "/data/s.ply").code, ErrorCode::internal);
  EXPECT_EQ(file_error(ENOSPC, "write", "/data/s.ply").message, "cannot write /data/s.ply: No space left on device");
}

}  // namespace
}  // namespace engine
