#include "engine/select/exposed.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/engine/select/small_scenes.h"

namespace engine::select {
namespace {

/// A closed box of sheets around the origin, two units wide, and rows within it, which are the last ones.
scene::GaussianCloud box_with_rows_within(std::size_t& within) {
  constexpr int side = 20;
  constexpr float spacing = 0.1f;
  scene::GaussianCloud cloud;
  for (int axis = 0; axis < 3; ++axis)
    for (const float at : {-1.0f, 1.0f})
      for (int v = 0; v < side; ++v)
        for (int u = 0; u < side; ++u) {
          Vec3 mean(spacing * (float(u) - 0.5f * (side - 1)), spacing * (float(v) - 0.5f * (side - 1)), at);
          for (int turn = 0; turn < axis; ++turn) mean = {mean.z, mean.x, mean.y};
          add_at(cloud, mean, 6, std::log(0.8f * spacing));
        }
  within = cloud.size();
  for (int z = -2; z <= 2; ++z)
    for (int y = -2; y <= 2; ++y)
      for (int x = -2; x <= 2; ++x) add_at(cloud, 0.25f * Vec3(x, y, z), 2, std::log(0.08f));
  return cloud;
}

TEST(ExposedRows, AreThoseOfABodysSurfaceAndNotWhatIsWithin) {
  std::size_t within = 0;
  const scene::GaussianCloud cloud = box_with_rows_within(within);
  const auto shows = exposed_rows(cloud);
  EXPECT_EQ(std::count(shows.begin() + std::ptrdiff_t(within), shows.end(), 1), 0);
  EXPECT_GT(std::count(shows.begin(), shows.begin() + std::ptrdiff_t(within), 1), 0.95 * double(within));
}

TEST(ExposedRows, AreTheSameInAnyPlaceAndSize) {
  std::size_t within = 0;
  const scene::GaussianCloud cloud = box_with_rows_within(within);
  const auto expected = exposed_rows(cloud);
  for (const float scale : {1.0f / 1048576, 1048576.0f}) {  // powers of two: means keep their digits
    scene::GaussianCloud other = cloud;
    for (std::size_t row = 0; row < other.size(); ++row) {
      other.mean.set(row, scale * (cloud.mean.get(row) + Vec3(4, 8, -2)));
      other.log_scale.set(row, cloud.log_scale.get(row) + std::log(scale));
    }
    const auto shows = exposed_rows(other);
    std::size_t differ = 0;
    for (std::size_t row = 0; row < shows.size(); ++row) differ += shows[row] != expected[row];
    EXPECT_LE(differ, 10u) << scale;  // whose weight is next to the limit
  }
}

TEST(ExposedRows, AreAllWhereAllAreAtOnePlaceAndNoneOfNone) {
  EXPECT_TRUE(exposed_rows({}).empty());
  EXPECT_EQ(exposed_rows(cloud_at({{1, 2, 3}})), std::vector<std::uint8_t>{1});
  EXPECT_EQ(exposed_rows(cloud_at({{1, 2, 3}, {1, 2, 3}})), (std::vector<std::uint8_t>{1, 1}));
}

TEST(ExposedRows, AreNoneOfThoseThatNothingShows) {
  scene::GaussianCloud cloud = cloud_at({{0, 0, 0}, {1, 0, 0}});
  cloud.opacity_logit[1] = -30;
  EXPECT_EQ(exposed_rows(cloud), (std::vector<std::uint8_t>{1, 0}));
}

}  // namespace
}  // namespace engine::select
