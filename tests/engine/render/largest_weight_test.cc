#include "engine/render/largest_weight.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "engine/core/parallel.h"
#include "tests/engine/render/test_scenes.h"

namespace engine::render {
namespace {

std::vector<float> largest(const scene::GaussianCloud& cloud, const scene::Camera& camera) {
  Workspace workspace;
  std::vector<float> out(cloud.size(), 0.0f);
  raise_to_largest_weights(cloud, camera, workspace, out);
  return out;
}

/// What forward() blends of one row, at the pixel where it is most.
float largest_by_forward(const scene::GaussianCloud& cloud, const scene::Camera& camera, std::size_t row) {
  std::vector<float> weight(cloud.size(), 0.0f);
  weight[row] = 1;
  const Rendering rendering = forward(cloud, camera, {.color = false}, weight);
  return *std::max_element(rendering.weight.data.begin(), rendering.weight.data.end());
}

TEST(LargestWeight, IsThatOfForward) {
  const scene::GaussianCloud cloud = cloud_in_view(600, 4, 0);
  const scene::Camera camera = off_centre_camera(75, 53);  // no whole number of tiles
  const auto found = largest(cloud, camera);
  int shown = 0;
  for (std::size_t row = 0; row < cloud.size(); ++row) {
    const float expected = largest_by_forward(cloud, camera, row);
    EXPECT_NEAR(found[row], expected, 1e-6f) << row;
    shown += expected > 0.1f;
  }
  EXPECT_GT(shown, 20);
}

TEST(LargestWeight, IsZeroOfWhatIsHidden) {
  scene::GaussianCloud cloud;
  add_on_axis(cloud, 1, 10, 1);
  add_on_axis(cloud, 2, 10, 1);
  add_on_axis(cloud, 3, 10, 1);  // two splats of 0.99 leave 1e-4, where rays end
  add_on_axis(cloud, -3, 10, 1);
  const auto found = largest(cloud, one_pixel_camera());
  EXPECT_NEAR(found[0], 0.99f, 1e-6f);
  EXPECT_LT(found[1], 0.01f);
  EXPECT_EQ(found[2], 0.0f);
  EXPECT_EQ(found[3], 0.0f) << "behind the camera";
}

TEST(LargestWeight, IsTheLargestOverCamerasAndThreads) {
  const scene::GaussianCloud cloud = cloud_in_view(600, 4, 0);
  const scene::Camera one = off_centre_camera(75, 53), other = off_centre_camera(120, 160);
  std::vector<float> both(cloud.size(), 0.0f), again(cloud.size(), 0.0f);
  for (auto [threads, out] : {std::pair{1, &both}, {4, &again}})
    WorkArena(threads).run([&] {
      Workspace workspace;
      for (const scene::Camera& camera : {one, other}) raise_to_largest_weights(cloud, camera, workspace, *out);
    });
  EXPECT_EQ(both, again);
  const auto first = largest(cloud, one), second = largest(cloud, other);
  for (std::size_t row = 0; row < cloud.size(); ++row) EXPECT_EQ(both[row], std::max(first[row], second[row]));
}

}  // namespace
}  // namespace engine::render
