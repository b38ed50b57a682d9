#include "engine/render/frame.h"

#include <gtest/gtest.h>

#include <numeric>
#include <string>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "tests/engine/render/test_scenes.h"

namespace engine::render {
namespace {

scene::Image noise(const scene::Camera& camera) {
  scene::Image image(camera.width, camera.height, 3);
  Rng rng(5);
  for (float& value : image.data) value = rng.normal();
  return image;
}

/// Picture and gradients of a Frame that has drawn something larger, and walked it back, before.
struct Both {
  scene::Image color;
  Gradients gradients;
};
Both of_frame(const scene::GaussianCloud& cloud, const scene::Camera& camera, Vec3 background) {
  Frame frame;
  const scene::Camera other = off_centre_camera(33, 90);
  scene::Image earlier(other.width, other.height, 3);
  const scene::GaussianCloud larger = cloud_in_view(5000, 9, cloud.sh_degree);
  frame.forward(larger, other, Vec3(1.0f), earlier);
  Gradients of_larger;
  of_larger.reset(larger.size(), larger.sh_degree);
  frame.backward(larger, noise(other), of_larger);
  Both out{scene::Image(camera.width, camera.height, 3, 7.0f), {}};
  frame.forward(cloud, camera, background, out.color);
  out.gradients.reset(cloud.size(), cloud.sh_degree);
  frame.backward(cloud, noise(camera), out.gradients);
  return out;
}

void expect_equal(const Gradients& a, const Gradients& b) {
  EXPECT_EQ(a.mean, b.mean);
  EXPECT_EQ(a.log_scale, b.log_scale);
  EXPECT_EQ(a.rotation, b.rotation);
  EXPECT_EQ(a.opacity_logit, b.opacity_logit);
  EXPECT_EQ(a.sh, b.sh);
  EXPECT_EQ(a.mean2d_x_px, b.mean2d_x_px);
  EXPECT_EQ(a.mean2d_y_px, b.mean2d_y_px);
}

void expect_bytes_of_forward_and_backward() {
  const Vec3 background(0.2f, 0.5f, 0.1f);
  for (const int degree : {0, 3}) {
    const scene::GaussianCloud cloud = cloud_in_view(2000, 1, degree);
    const scene::Camera camera = off_centre_camera();
    const Both found = of_frame(cloud, camera, background);

    EXPECT_EQ(found.color, forward(cloud, camera, {.background = background}).color);
    std::vector<std::uint32_t> rows(cloud.size());
    std::iota(rows.begin(), rows.end(), 0u);
    Gradients expected;
    expected.reset(rows.size(), degree);
    BackwardWorkspace workspace;
    backward(cloud, camera, {.forward = {.background = background}}, {.color = noise(camera)}, rows, workspace,
             expected);
    expect_equal(found.gradients, expected);
  }
}

TEST(Frame, GivesTheBytesOfForwardAndBackwardWithEveryInstructionSet) {
  const std::string best = simd_target();
  for (const std::string& target : simd_targets()) {
    SCOPED_TRACE(target);
    ASSERT_TRUE(pin_simd_target(target));
    expect_bytes_of_forward_and_backward();
  }
  ASSERT_TRUE(pin_simd_target(best));
}

TEST(Frame, GivesTheSameBytesForAnyNumberOfThreads) {
  const scene::GaussianCloud cloud = cloud_in_view(2000, 1);
  const scene::Camera camera = off_centre_camera(150, 130);
  Both one, four;
  WorkArena(1).run([&] { one = of_frame(cloud, camera, Vec3(0.0f)); });
  WorkArena(4).run([&] { four = of_frame(cloud, camera, Vec3(0.0f)); });
  EXPECT_EQ(one.color, four.color);
  expect_equal(one.gradients, four.gradients);
}

TEST(Frame, DrawsTheBackgroundWhereThereIsNothing) {
  const scene::Camera camera = off_centre_camera();
  scene::GaussianCloud nothing;
  const Both found = of_frame(nothing, camera, Vec3(0.25f));
  EXPECT_EQ(found.color, scene::Image(camera.width, camera.height, 3, 0.25f));
  EXPECT_EQ(found.gradients.size(), 0u);
}

}  // namespace
}  // namespace engine::render
