#include "engine/io/zip_archive.h"

#include <gtest/gtest.h>

#include "tests/engine/io/samples.h"

namespace engine::io {
namespace {

std::vector<NamedFile> two_files() {
  return {{"a.txt", std::vector<std::byte>(300, std::byte{7})}, {"b/c.txt", {std::byte{1}, std::byte{2}}}};
}

TEST(ZipArchive, GivesBackWhatItWasMadeOf) {
  const auto zip = make_zip(two_files());
  ASSERT_TRUE(zip);
  EXPECT_TRUE(looks_like_zip(*zip));
  EXPECT_EQ(*zip, make_zip(two_files()).value()) << "the same bytes every time";
  const auto archive = ZipArchive::open(*zip, "a.zip");
  ASSERT_TRUE(archive) << archive.error().message;
  ASSERT_EQ(archive->names().size(), 2u);
  for (const NamedFile& file : two_files()) EXPECT_EQ(archive->read(file.name, 1000, nullptr)->bytes, file.bytes);
}

// Found by tests/fuzz: libzip writes nothing then, and says nothing of its length.
TEST(ZipArchive, OfNoFilesIsRefused) {
  const auto zip = make_zip({});
  ASSERT_FALSE(zip);
  EXPECT_EQ(zip.error().code, ErrorCode::invalid_argument);
}

TEST(ZipArchive, CutAtAnyByteIsAnError) {
  const auto zip = make_zip(two_files()).value();
  // No bytes at all are, to libzip, an archive without files.
  for (std::size_t size = 1; size < zip.size(); ++size)
    EXPECT_FALSE(ZipArchive::open(std::span(zip).first(size), "a.zip")) << size;
}

TEST(ZipArchive, ADamagedFileIsFoundByItsChecksum) {
  auto zip = make_zip(two_files()).value();
  zip[100] ^= std::byte{1};  // within a.txt
  const auto archive = ZipArchive::open(zip, "a.zip");
  ASSERT_TRUE(archive);
  const auto damaged = archive->read("a.txt", 1000, nullptr);
  ASSERT_FALSE(damaged);
  EXPECT_EQ(damaged.error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(damaged.error().where, "a.zip:a.txt");
}

TEST(ZipArchive, KeepsToItsLimits) {
  const auto zip = make_zip(two_files()).value();
  EXPECT_EQ(ZipArchive::open(zip, "a.zip", 1).error().code, ErrorCode::too_large);
  const auto archive = ZipArchive::open(zip, "a.zip");
  ASSERT_TRUE(archive);
  EXPECT_EQ(archive->read("a.txt", 299, nullptr).error().code, ErrorCode::too_large);
  MemoryBudget little(299), enough(300);
  EXPECT_EQ(archive->read("a.txt", 1000, &little).error().code, ErrorCode::too_large);
  {
    const auto file = archive->read("a.txt", 1000, &enough);
    ASSERT_TRUE(file);
    EXPECT_EQ(enough.lent(), 300u);
  }
  EXPECT_EQ(enough.lent(), 0u);
  EXPECT_EQ(archive->read("none", 10, nullptr).error().code, ErrorCode::not_found);
}

}  // namespace
}  // namespace engine::io
