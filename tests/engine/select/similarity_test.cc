#include "engine/select/similarity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "tests/engine/select/small_scenes.h"

namespace engine::select {
namespace {

neighbours::NeighbourGraph joined(const scene::GaussianCloud& cloud, std::vector<std::uint32_t>& rows) {
  rows.resize(cloud.size());
  std::iota(rows.begin(), rows.end(), 0u);
  const std::vector<float> points = neighbours::points_of(cloud.mean, rows, DVec3(0.0));
  return neighbours::join_nearest(points, neighbours::PointIndex(points, 3), 4);
}

/// Of the only edge of two discs in the plane z = 0, 0.1 apart, after the second one was changed.
template <class Change>
float similarity_after(Change&& change) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {0, 0, 0}, 2, 0.1f, Vec3(0.5f));
  cloud = scene::select(cloud, std::vector<std::uint8_t>{1, 1, 0, 0});
  change(cloud);
  std::vector<std::uint32_t> rows;
  const neighbours::NeighbourGraph graph = joined(cloud, rows);
  const std::vector<float> found = similarity_of_edges(cloud, rows, graph);
  EXPECT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0], found[1]) << "the same both ways";
  return found[0];
}

TEST(Similarity, FallsWithDistanceColorNormalAndSize) {
  const float same = similarity_after([](scene::GaussianCloud&) {});
  EXPECT_GT(same, 0.5f);
  EXPECT_LE(same, 1.0f);
  const auto less = [&](auto&& change) { EXPECT_LT(similarity_after(change), 0.7f * same); };
  less([](scene::GaussianCloud& c) { c.sh_row(1)[0] += 1.0f; });
  less([](scene::GaussianCloud& c) { c.rotation.set(1, {1, 0, 1, 0}); });
  less([](scene::GaussianCloud& c) { c.log_scale.set(1, c.log_scale.get(1) + Vec3(3.0f)); });
}

TEST(Similarity, FallsWhereOneHardlyShows) {
  const auto logit = [](float opacity) { return std::log(opacity / (1 - opacity)); };
  const float same = similarity_after([](scene::GaussianCloud&) {});
  EXPECT_EQ(similarity_after([&](scene::GaussianCloud& c) { c.opacity_logit[1] = logit(0.06f); }), same);
  const float haze = similarity_after([&](scene::GaussianCloud& c) { c.opacity_logit[1] = logit(0.005f); });
  EXPECT_NEAR(haze / same, 0.1f, 1e-3f);
  const float both =
      similarity_after([&](scene::GaussianCloud& c) { c.opacity_logit[0] = c.opacity_logit[1] = logit(0.005f); });
  EXPECT_NEAR(both / same, 0.01f, 1e-3f);
}

TEST(Similarity, IsANumberAtTheExtremes) {
  for (const float log_scale : {-1e30f, -100.0f, 100.0f, 1e30f})
    for (const float place : {0.0f, 1e-30f, 1e30f}) {
      const float found = similarity_after([&](scene::GaussianCloud& c) {
        c.log_scale.set(0, {log_scale, 0, -log_scale});
        c.log_scale.set(1, Vec3(log_scale));
        c.mean.set(0, Vec3(0.0f));
        c.mean.set(1, {place, 0, 0});
        c.rotation.set(1, {0, 0, 0, 0});
        c.opacity_logit[1] = -std::numeric_limits<float>::max();
      });
      EXPECT_GE(found, 0.0f) << log_scale << ' ' << place;
      EXPECT_LE(found, 1.0f) << log_scale << ' ' << place;
    }
}

TEST(Cover, IsOpacityTimesFalloff) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {0, 0, 0}, 1, 0.1f, Vec3(0.5f));
  cloud.log_scale.set(0, Vec3(std::log(0.3f)));
  cloud.opacity_logit[0] = 0;
  const DVec3 mean(cloud.mean.get(0));
  EXPECT_NEAR(cover(cloud, 0, 0.8, mean), 0.5, 1e-6);
  EXPECT_NEAR(cover(cloud, 0, 0.8, mean + DVec3(0.5, 0, 0)), 0.5 * std::exp(-0.5), 1e-6) << "0.3 and half the spacing";
  EXPECT_EQ(cover(cloud, 0, 0.0, mean + DVec3(1e30, 0, 0)), 0.0);
}

}  // namespace
}  // namespace engine::select
