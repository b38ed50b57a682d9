#include "engine/repair/vacated.h"

#include <gtest/gtest.h>

#include <array>
#include <numeric>
#include <span>
#include <string_view>

#include "engine/working/working_scene.h"
#include "tests/engine/edit/block.h"

namespace engine::repair {
namespace {

using working::Role, working::WorkingScene;

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
  [[nodiscard]] std::vector<std::uint32_t> open() const {
    return rows_left_open(original, left, interleaved(working.cloud().mean, arrived));
  }
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
  EXPECT_TRUE(rows_left_open(strip.original, {}, interleaved(strip.working.cloud().mean, strip.arrived)).empty());
  EXPECT_EQ(rows_left_open(strip.original, strip.left, {}), strip.left);
}

TEST(RowsLeftOpen, OneRowAloneIsOpenOnceItHasMoved) {
  const Strip strip({0.01f, 0, 0});
  const std::vector<std::uint32_t> one{7}, now{strip.arrived[7]};
  EXPECT_EQ(rows_left_open(strip.original, one, interleaved(strip.working.cloud().mean, now)), one);
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

/// A mask drawn by a character per pixel: '.' is not set.
scene::Mask drawn(std::span<const std::string_view> rows) {
  scene::Mask mask(int(rows[0].size()), int(rows.size()));
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x) mask.at(x, y) = rows[std::size_t(y)][std::size_t(x)] != '.';
  return mask;
}

TEST(Air, IsWhereNothingIsAllTheWayFromBesideTheHole) {
  constexpr std::array<std::string_view, 6> empty{"oooooooooooo",  //
                                                  "oooooooooooo",  //
                                                  "oooooo......",  //
                                                  "oooooo.ooo..",  // a hole in what stands there
                                                  "oooooo.ooo..",  //
                                                  "oooooo......"};
  constexpr std::array<std::string_view, 6> vacated{"............",  //
                                                    "............",  //
                                                    "...ooooooooo",  //
                                                    "...ooooooooo",  //
                                                    "...ooooooooo",  //
                                                    "............"};
  const scene::Mask found = air(drawn(empty), drawn(vacated));
  for (int y = 0; y < 6; ++y)
    for (int x = 0; x < 12; ++x)
      EXPECT_EQ(found.at(x, y), vacated[std::size_t(y)][std::size_t(x)] == 'o' && x < 6) << x << " " << y;
}

TEST(Air, IsNotToldByASpeckBesideAHole) {
  // 256 rows, so that what is blurred is a pixel wide: one alone beside the hole shows nothing.
  scene::Mask empty(256, 256), vacated(256, 256);
  for (int y = 100; y < 140; ++y)
    for (int x = 100; x < 140; ++x) empty.at(x, y) = vacated.at(x, y) = 1;
  empty.at(99, 120) = 1;
  EXPECT_EQ(air(empty, vacated).area(), 0u);
  for (int y = 0; y < 256; ++y)
    for (int x = 0; x < 100; ++x) empty.at(x, y) = 1;
  EXPECT_NEAR(double(air(empty, vacated).area()), double(vacated.area()), 4) << "nothing at all on one side of it";
}

TEST(Air, DoesNotComeThroughACrack) {
  scene::Mask empty(256, 256), vacated(256, 256);
  for (int y = 100; y < 140; ++y)
    for (int x = 100; x < 140; ++x) empty.at(x, y) = vacated.at(x, y) = 1;
  for (int y = 0; y < 256; ++y)
    for (int x = 0; x < 80; ++x) empty.at(x, y) = 1;
  for (int x = 80; x < 100; ++x) empty.at(x, 120) = 1;
  EXPECT_EQ(air(empty, vacated).area(), 0u);
}

TEST(Air, IsNoneWhereSomethingIsEverywhereOrNothingWasLeft) {
  EXPECT_EQ(air(scene::Mask(8, 8), scene::Mask(8, 8)).area(), 0u);
  scene::Mask all(8, 8);
  for (std::uint8_t& pixel : all.data) pixel = 1;
  EXPECT_EQ(air(scene::Mask(8, 8), all).area(), 0u);
  EXPECT_EQ(air(all, scene::Mask(8, 8)).area(), 0u);
}

}  // namespace
}  // namespace engine::repair
