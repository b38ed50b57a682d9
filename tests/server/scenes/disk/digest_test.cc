#include "server/scenes/disk/digest.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <thread>

#include "tests/support/data.h"

namespace server::scenes {
namespace {

using engine::ErrorCode;

TEST(Digest, IsWhatXxhsumPrints) {  // xxhsum -H3 of 0.8.1
  EXPECT_EQ(digest_of(""), "2d06800538d394c2");
  EXPECT_EQ(digest_of("hi\n"), "b34d1a3ab2bece70");
}

TEST(Digest, OfAFileIsThatOfItsBytes) {
  const support::TempDir temp;
  for (const std::size_t size : {0u, 1u, 240u, 241u, 262143u, 262144u, 262145u, 1000000u}) {
    std::string bytes(size, 'x');
    for (std::size_t i = 0; i < size; ++i) bytes[i] = char(i * 2654435761u >> 13);
    support::write_file(temp.path() / "file", bytes);
    EXPECT_EQ(digest_of_file(temp.path() / "file"), digest_of(bytes)) << size;
  }
}

TEST(Digest, SeesEveryBitAndEveryCut) {
  const support::TempDir temp;
  const auto file = temp.path() / "file";
  const std::string whole = "some thirty bytes of nothing much";
  const std::string digest = digest_of(whole);
  support::write_file(file, whole);
  EXPECT_TRUE(check_digest(file, digest, "scenes/file"));
  for (std::size_t bit = 0; bit < 8 * whole.size(); ++bit) {
    std::string damaged = whole;
    damaged[bit / 8] = char(damaged[bit / 8] ^ 1 << bit % 8);
    support::write_file(file, damaged);
    const auto checked = check_digest(file, digest, "scenes/file");
    ASSERT_FALSE(checked) << bit;
    EXPECT_EQ(checked.error().code, ErrorCode::corrupt_data);
    EXPECT_EQ(checked.error().where, "scenes/file");
  }
  for (std::size_t size = 0; size < whole.size(); ++size) {
    support::write_file(file, whole.substr(0, size));
    EXPECT_FALSE(check_digest(file, digest, "")) << size;
  }
  EXPECT_TRUE(check_digest(file, "", "")) << "none was noted";
  EXPECT_EQ(check_digest(temp.path() / "absent", digest, "a").error().code, ErrorCode::corrupt_data);
}

TEST(SoundFiles, ReadAFileAgainOnceItIsAnother) {
  const support::TempDir temp;
  const auto file = temp.path() / "file";
  support::write_file(file, "sound");
  SoundFiles files;
  EXPECT_TRUE(files.check(file, digest_of("sound"), ""));
  EXPECT_TRUE(files.check(file, digest_of("sound"), ""));
  EXPECT_FALSE(files.check(file, digest_of("other"), "")) << "held against another digest";
  support::write_file(file, "soUnd");
  EXPECT_FALSE(files.check(file, digest_of("sound"), ""));
}

TEST(SoundFiles, ReadAFileOnceAsLongAsItIsTheSame) {
  const support::TempDir temp;
  const auto file = temp.path() / "file";
  support::write_file(file, "sound");
  SoundFiles files, forgetful(std::chrono::seconds(0));
  std::this_thread::sleep_for(std::chrono::milliseconds(3100));  // a file that has just changed is always read
  EXPECT_TRUE(files.check(file, digest_of("sound"), ""));
  EXPECT_TRUE(forgetful.check(file, digest_of("sound"), ""));
  EXPECT_TRUE(files.check(file, digest_of("sound"), ""));
  support::write_file(file, "soUnd");
  EXPECT_FALSE(files.check(file, digest_of("sound"), ""));
  EXPECT_FALSE(forgetful.check(file, digest_of("sound"), ""));
}

}  // namespace
}  // namespace server::scenes
