#include "engine/working/footprint.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/render/forward.h"
#include "tests/engine/edit/samples.h"

namespace engine::working {
namespace {

using edit::arc_of_cameras, edit::ball_before_wall;

/// The footprint from a rendering of the whole picture.
scene::Image whole_footprint(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                             const scene::Camera& camera) {
  std::vector<float> member(cloud.size(), 0.0f);
  for (const std::uint32_t row : rows) member[row] = 1.0f;
  render::ForwardOptions options;
  options.color = false;
  return render::forward(cloud, camera, options, member).weight;
}

TEST(Footprint, OfAPartOfThePictureIsThatOfTheWhole) {
  scene::GaussianCloud cloud = ball_before_wall(40);
  render::Workspace workspace;
  Rng rng(4);
  for (int trial = 0; trial < 20; ++trial) {
    const std::vector<std::uint32_t> rows{rng.below(std::uint32_t(cloud.size())),
                                          rng.below(std::uint32_t(cloud.size()))};
    // Needles, splats larger than the picture, and ones beside and behind the camera.
    cloud.log_scale.set(rows[0], {rng.uniform(-8, 1), rng.uniform(-8, 1), rng.uniform(-8, 1)});
    cloud.mean.set(rows[1], {rng.uniform(-4, 4), rng.uniform(-4, 4), rng.uniform(-4, 4)});
    for (const scene::Camera& camera : arc_of_cameras(3, 48)) {
      const scene::Image part = footprint(cloud, rows, camera, workspace), whole = whole_footprint(cloud, rows, camera);
      ASSERT_EQ(part.data.size(), whole.data.size());
      for (std::size_t i = 0; i < part.data.size(); ++i)
        ASSERT_NEAR(part.data[i], whole.data[i], 1e-5f) << trial << ": pixel " << i;
    }
  }
}

TEST(Footprint, OfNothingOrOfWhatIsBehindTheCameraIsEmpty) {
  const scene::GaussianCloud cloud = ball_before_wall(5);
  scene::Camera camera = scene::look_at(DVec3(0, 0, -3), DVec3(0, 0, -6), DVec3(0, -1, 0), 0.9, 16, 16);
  render::Workspace workspace;
  for (const std::vector<std::uint32_t>& rows : {std::vector<std::uint32_t>{}, std::vector<std::uint32_t>{0, 1, 2}}) {
    EXPECT_TRUE(touched_rect(cloud, rows, camera).empty());
    EXPECT_EQ(footprint(cloud, rows, camera, workspace), scene::Image(16, 16, 1));
  }
}

}  // namespace
}  // namespace engine::working
