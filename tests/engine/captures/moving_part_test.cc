#include "engine/captures/moving_part.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/engine/captures/samples.h"

namespace engine::captures {
namespace {

/// Discs of half-axes 0.2 and 0.1 at x = 0, 1, 2, 3; opacity one half.
scene::GaussianCloud row_of_discs() {
  scene::GaussianCloud cloud;
  cloud.resize(4);
  for (std::size_t i = 0; i < 4; ++i) {
    cloud.mean.set(i, {float(i), 0, 0});
    cloud.rotation.set(i, {1, 0, 0, 0});
    cloud.log_scale.set(i, {std::log(0.01f), std::log(0.2f), std::log(0.1f)});
    cloud.opacity_logit[i] = 0;
  }
  return cloud;
}

TEST(MovingPart, HoldsWhatIsNextToASurfaceThatMoves) {
  const std::vector<std::uint32_t> part{1, 2};
  const MovingPart moving(row_of_discs(), part);
  EXPECT_TRUE(moving.holds(DVec3(1.02, 0, 0.03)));
  EXPECT_TRUE(moving.holds(DVec3(2, 0, 0)));
  EXPECT_FALSE(moving.holds(DVec3(0, 0, 0))) << "a surface that stays";
  EXPECT_FALSE(moving.holds(DVec3(2, 0.9 * belongs_within, 0.9 * belongs_within))) << "a floater";
  EXPECT_FALSE(moving.holds(DVec3(1.49, 0, 0))) << "too far from any";
  EXPECT_FALSE(MovingPart().holds(DVec3(0, 0, 0)));
}

TEST(MovingPart, OfAllPlacesAtOnceIsThatOfEach) {
  const std::vector<std::uint32_t> part{3};
  const MovingPart moving(row_of_discs(), part);
  EXPECT_EQ(moving.holds(row_of_discs().mean), (std::vector<std::uint8_t>{0, 0, 0, 1}));
}

TEST(OpacitiesTimesArea, CountTheTwoLongerAxes) {
  EXPECT_NEAR(opacities_times_area(row_of_discs())[0], 0.5 * std::numbers::pi * 0.2 * 0.1, 1e-8);
}

TEST(ShownAreas, CountWhatIsInFrontAndNothingBehindIt) {
  scene::GaussianCloud cloud;
  cloud.resize(2);  // one behind the other, both wider than the picture
  for (std::size_t i = 0; i < 2; ++i) {
    cloud.mean.set(i, {0, 0, float(2 + i)});
    cloud.rotation.set(i, {1, 0, 0, 0});
    cloud.log_scale.set(i, {3, 3, -3});
    cloud.opacity_logit[i] = 0;
  }
  scene::Camera front = sample_camera(0);
  front.rotation = DMat3(1.0), front.translation = DVec3(0.0);
  const std::vector<double> once = shown_areas(cloud, std::vector{front});
  const double pixels = front.width * front.height;
  EXPECT_NEAR(once[0], 0.5 * pixels, 0.01 * pixels);
  EXPECT_NEAR(once[1], 0.25 * pixels, 0.01 * pixels);
  EXPECT_NEAR(shown_areas(cloud, std::vector{front, front})[1], 2 * once[1], 1e-3);
}

TEST(Match, CountsByWhatItIsGiven) {
  scene::GaussianCloud cloud = row_of_discs();
  cloud.log_scale.set(2, {std::log(0.01f), std::log(0.4f), std::log(0.1f)});  // twice as large
  const std::vector<std::uint32_t> part{1, 2};
  const MovingPart moving(row_of_discs(), part);
  const auto matched = [&](std::vector<std::uint32_t> rows) {
    return match(cloud, rows, moving, opacities_times_area(cloud));
  };
  EXPECT_NEAR(matched({1}).recall, 1.0 / 3, 1e-6);
  EXPECT_NEAR(matched({1}).precision, 1, 1e-6);
  EXPECT_NEAR(matched({0, 2}).recall, 2.0 / 3, 1e-6);
  EXPECT_NEAR(matched({0, 2}).precision, 2.0 / 3, 1e-6);
  EXPECT_NEAR(matched({0, 1, 2, 3}).recall, 1, 1e-6);
  EXPECT_NEAR(matched({0, 1, 2, 3}).precision, 3.0 / 5, 1e-6);
  EXPECT_EQ(matched({}).recall, 0);
  EXPECT_EQ(matched({}).precision, 1) << "nothing was chosen";
  EXPECT_EQ(match(cloud, std::vector<std::uint32_t>{0}, MovingPart(), std::vector<double>(4, 1.0)).recall, 1)
      << "nothing moves";
}

}  // namespace
}  // namespace engine::captures
