#include "server/scenes/disk/digest.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

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

TEST(RunningDigest, IsThatOfTheFileHoweverItIsRead) {
  const support::TempDir temp;
  const std::string text = "a file of some length, of which readers read what they like";
  support::write_file(temp.path() / "file", text);
  const auto bytes = std::as_bytes(std::span(text));
  using Parts = std::vector<std::pair<std::size_t, std::size_t>>;  // from, count
  for (const Parts& parts : {Parts{},
                             {{0, 5}},
                             {{0, 5}, {5, 10}},
                             {{0, 20}, {5, 30}},
                             {{0, 20}, {5, 3}, {30, 4}},
                             {{7, 3}, {0, bytes.size()}},
                             {{0, bytes.size()}, {0, bytes.size()}}}) {
    RunningDigest seen, seen_other;
    for (const auto& [from, count] : parts) seen.see(from, bytes.subspan(from, count));
    EXPECT_TRUE(seen.check(temp.path() / "file", digest_of(text), ""));
    std::string other = text;
    other[2] = 'X';
    for (const auto& [from, count] : parts) seen_other.see(from, std::as_bytes(std::span(other)).subspan(from, count));
    if (!parts.empty()) {
      EXPECT_FALSE(seen_other.check(temp.path() / "file", digest_of(text), "")) << "it is of what was read";
    }
  }
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
