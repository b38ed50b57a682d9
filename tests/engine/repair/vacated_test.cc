#include "engine/repair/vacated.h"

#include <gtest/gtest.h>

#include <numeric>

#include "tests/engine/edit/block.h"

namespace engine::repair {
namespace {

using working::Role;

constexpr int length = 40, width = 6;
constexpr float spacing = 0.1f;

/// A strip of rows along x, all of which moved by this much.
struct Strip {
  scene::GaussianCloud original;
  WorkingScene working;
  std::vector<std::uint32_t> left, arrived;

  explicit Strip(Vec3 by) {
    for (int i = 0; i < length; ++i)
      for (int j = 0; j < width; ++j)
        edit::add_gaussian(original, spacing * Vec3(i, j, 0), Vec3(0.05f), 4, edit::block_color);
    left.resize(original.size());
    std::iota(left.begin(), left.end(), 0u);
    working = WorkingScene(original, working::Frame(), working::HandleColumn(original.size(), 1));
    const std::uint32_t first = working.append(original, left, std::vector<Role>(left.size(), Role::copy), left);
    for (const std::uint32_t row : left) {
      arrived.push_back(first + row);
      working.gaussians().mean.set(first + row, original.mean.get(row) + by);
      working.leave_behind(row);
    }
  }
  [[nodiscard]] std::vector<std::uint32_t> open() const { return rows_left_open(original, left, working, arrived); }
};

TEST(RowsLeftOpen, AreAllIfThePartWentAway) {
  const Strip strip({0, 0, 5});
  EXPECT_EQ(strip.open(), strip.left);
}

TEST(RowsLeftOpen, AreNoneIfItStayed) { EXPECT_TRUE(Strip({0, 0, 0}).open().empty()); }

TEST(RowsLeftOpen, AreTheEndOfWhatSlidAlongItself) {
  for (const float columns : {10.0f, 10.5f}) {  // onto each other, and between
    const Strip strip({columns * spacing, 0, 0});
    const auto open = strip.open();
    ASSERT_FALSE(open.empty());
    for (const std::uint32_t row : open) EXPECT_LT(row, 10u * width);
    EXPECT_GE(open.size(), 8u * width) << "but for what is close to where it begins now";
  }
}

TEST(RowsLeftOpen, OfNothingAreNoneAndWithoutAnArrivalAll) {
  const Strip strip({0, 0, 0});
  EXPECT_TRUE(rows_left_open(strip.original, {}, strip.working, strip.arrived).empty());
  EXPECT_EQ(rows_left_open(strip.original, strip.left, strip.working, {}), strip.left);
}

TEST(RowsLeftOpen, OneRowAloneIsOpenOnceItHasMoved) {
  const Strip strip({0.01f, 0, 0});
  const std::vector<std::uint32_t> one{7}, now{strip.arrived[7]};
  EXPECT_EQ(rows_left_open(strip.original, one, strip.working, now), one);
}

TEST(FarSide, IsThatOfTheFarthestRowWithinTwoPixels) {
  const scene::Camera camera = scene::look_at(DVec3(0, 0, -3), DVec3(0), DVec3(0, -1, 0), 0.9, 32, 32);
  scene::GaussianCloud cloud;
  for (const float z : {0.0f, 1.0f, 0.5f}) edit::add_gaussian(cloud, {0, 0, z}, Vec3(0.01f), 4, edit::block_color);
  const std::vector<std::uint32_t> all{0, 1, 2}, near{0, 2};
  const scene::Image far = far_side(cloud, all, camera);
  EXPECT_NEAR(far.at(16, 16), 4, 1e-6);
  EXPECT_NEAR(far.at(18, 15), 4, 1e-6);
  EXPECT_EQ(far.at(20, 16), 0);
  EXPECT_NEAR(far_side(cloud, near, camera).at(16, 16), 3.5, 1e-6);
  EXPECT_EQ(far_side(cloud, {}, camera), scene::Image(32, 32, 1));
}

TEST(FarSide, IsNowhereForRowsBehindTheCameraOrFarBesideItsPicture) {
  const scene::Camera camera = scene::look_at(DVec3(0, 0, -3), DVec3(0), DVec3(0, -1, 0), 0.9, 32, 32);
  scene::GaussianCloud cloud;
  for (const Vec3 mean : {Vec3(0, 0, -5), Vec3(1e30f, 0, 0), Vec3(0, -1e30f, 1), Vec3(0, 0, -3)})
    edit::add_gaussian(cloud, mean, Vec3(0.01f), 4, edit::block_color);
  const std::vector<std::uint32_t> all{0, 1, 2, 3};
  EXPECT_EQ(far_side(cloud, all, camera), scene::Image(32, 32, 1));
}

}  // namespace
}  // namespace engine::repair
