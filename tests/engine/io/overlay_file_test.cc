#include "engine/io/overlay_file.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/engine/io/samples.h"
#include "tests/engine/scene/random_overlay.h"
#include "tests/support/data.h"

namespace engine::io {
namespace {

constexpr std::size_t base_rows = 20;

scene::GaussianCloud base_of(std::uint64_t seed = 1, std::size_t rows = base_rows, int degree = 1) {
  scene::GaussianCloud cloud = random_cloud(rows, degree, seed);
  cloud.extra_stride = 3;
  cloud.extra.resize(3 * rows);
  for (std::size_t i = 0; i < cloud.extra.size(); ++i) cloud.extra[i] = std::byte(i * 37);
  return cloud;
}

scene::Overlay overlay_of(std::uint64_t seed = 2) {
  return scene::random_overlay(base_rows, 4, seed, [](std::size_t n, std::uint64_t s) { return base_of(s, n); });
}

class OverlayFile : public testing::Test {
 protected:
  std::filesystem::path path() const { return folder_.path() / "3"; }
  support::TempDir folder_;
};

TEST_F(OverlayFile, IsReadAsItWasWritten) {
  for (const scene::Overlay& overlay : {overlay_of(), overlay_of(9), scene::no_change(base_of())}) {
    ASSERT_TRUE(write_overlay(path(), overlay, base_of()));
    const auto read = read_overlay(path(), base_of());
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(*read, overlay);
  }
}

TEST_F(OverlayFile, CutAnywhereItIsAnError) {
  ASSERT_TRUE(write_overlay(path(), overlay_of(), base_of()));
  const std::string bytes = support::read_file(path());
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    support::write_file(path(), bytes.substr(0, length));
    const auto read = read_overlay(path(), base_of());
    ASSERT_FALSE(read) << length;
    EXPECT_EQ(read.error().code, ErrorCode::corrupt_data) << length;
    EXPECT_EQ(read.error().where, "3") << length;
  }
  support::write_file(path(), bytes + '\0');
  EXPECT_FALSE(read_overlay(path(), base_of()));
}

TEST_F(OverlayFile, AnyFlippedBitIsFound) {
  ASSERT_TRUE(write_overlay(path(), overlay_of(), base_of()));
  const std::string bytes = support::read_file(path());
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    std::string spoilt = bytes;
    spoilt[i] = char(spoilt[i] ^ 1 << i % 8);
    support::write_file(path(), spoilt);
    EXPECT_FALSE(read_overlay(path(), base_of())) << i;
  }
}

TEST_F(OverlayFile, AnotherBaseIsRefused) {
  ASSERT_TRUE(write_overlay(path(), overlay_of(), base_of()));
  scene::GaussianCloud without_extra = base_of();
  without_extra.extra_stride = 0, without_extra.extra.clear();
  for (const scene::GaussianCloud& base :
       {base_of(5), base_of(1, base_rows + 1), base_of(1, base_rows, 2), without_extra}) {
    const auto read = read_overlay(path(), base);
    ASSERT_FALSE(read);
    EXPECT_EQ(read.error().code, ErrorCode::conflict) << read.error().message;
  }
}

TEST_F(OverlayFile, ALaterVersionIsNamed) {
  ASSERT_TRUE(write_overlay(path(), overlay_of(), base_of()));
  std::string bytes = support::read_file(path());
  bytes[8] = 9;
  support::write_file(path(), bytes);
  const auto read = read_overlay(path(), base_of());
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::unsupported);
  EXPECT_NE(read.error().message.find("version 9"), std::string::npos) << read.error().message;
}

TEST_F(OverlayFile, LimitsAreKept) {
  ASSERT_TRUE(write_overlay(path(), overlay_of(), base_of()));
  EXPECT_EQ(read_overlay(path(), base_of(), {.max_gaussians = 5}).error().code, ErrorCode::too_large);
  EXPECT_EQ(read_overlay(path(), base_of(), {.max_memory_bytes = 100}).error().code, ErrorCode::too_large);
}

TEST_F(OverlayFile, NoFileIsNotFound) {
  EXPECT_EQ(read_overlay(path(), base_of()).error().code, ErrorCode::not_found);
  EXPECT_EQ(write_overlay(folder_.path() / "no" / "3", overlay_of(), base_of()).error().code, ErrorCode::not_found);
}

TEST_F(OverlayFile, PoisonIsNotWritten) {
  scene::Overlay overlay = overlay_of();
  overlay.rows.opacity_logit[2] = std::numeric_limits<float>::quiet_NaN();
  const auto poisoned = write_overlay(path(), overlay, base_of());
  ASSERT_FALSE(poisoned);
  EXPECT_EQ(poisoned.error().where, "3:rows[2].opacity");
  overlay = overlay_of();
  overlay.changed.push_back(1000);
  EXPECT_EQ(write_overlay(path(), overlay, base_of()).error().code, ErrorCode::internal);
  EXPECT_FALSE(std::filesystem::exists(path()));
}

}  // namespace
}  // namespace engine::io
