#include "engine/render/frozen_view.h"

#include <gtest/gtest.h>

#include <numeric>
#include <string>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/render/forward.h"

namespace engine::render {
namespace {

scene::Camera test_camera() { return scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1.0, 200, 150); }

/// Gaussians in front of the camera, around (x, y) of the picture plane at depth 1.
scene::GaussianCloud random_cloud(std::size_t n, std::uint64_t seed, float x, float y, float spread) {
  scene::GaussianCloud cloud;
  cloud.sh_degree = 1;
  cloud.resize(n);
  Rng rng(seed, 3);
  for (std::size_t i = 0; i < n; ++i) {
    const float z = rng.uniform(1.0f, 6.0f);
    cloud.mean.set(i, {z * (x + rng.uniform(-spread, spread)), z * (y + rng.uniform(-spread, spread)), z});
    cloud.log_scale.set(i, {rng.uniform(-5.0f, -3.0f), rng.uniform(-5.0f, -3.0f), rng.uniform(-5.0f, -3.0f)});
    cloud.rotation.set(i, {rng.normal(), rng.normal(), rng.normal(), rng.normal()});
    cloud.opacity_logit[i] = rng.uniform(-4.0f, 4.0f);
  }
  for (float& value : cloud.sh) value = 0.4f * rng.normal();
  return cloud;
}

scene::Image noise(int width, int height) {
  scene::Image image(width, height, 3);
  Rng rng(5);
  for (float& value : image.data) value = rng.normal();
  return image;
}

struct Scene {
  scene::GaussianCloud frozen = random_cloud(4000, 1, 0, 0, 0.5f);
  scene::GaussianCloud changeable = random_cloud(300, 2, 0.1f, 0.05f, 0.1f);
  std::vector<std::uint32_t> hidden{3, 17, 1029};
  scene::Camera camera = test_camera();
  [[nodiscard]] Layers layers() const {
    Layers out(frozen);
    out.top = &changeable, out.hidden = hidden;
    return out;
  }
  [[nodiscard]] Layers only_frozen() const {
    Layers out(frozen);
    out.hidden = hidden;
    return out;
  }
};

/// The pixels of `region` of a picture.
scene::Image part(const scene::Image& image, scene::Rect region) {
  scene::Image out(region.width(), region.height(), image.channels);
  for (int c = 0; c < image.channels; ++c)
    for (int y = 0; y < out.height; ++y)
      for (int x = 0; x < out.width; ++x) out.at(x, y, c) = image.at(region.x0 + x, region.y0 + y, c);
  return out;
}

TEST(FrozenView, GivesThePictureOfAllLayers) {
  const Scene scene;
  LocalFrame frame;
  const scene::Rect reach = frame.project(scene.changeable, scene.camera);
  ASSERT_FALSE(reach.empty());
  ASSERT_LT(reach.width(), scene.camera.width);
  const Vec3 background(0.2f, 0.5f, 0.1f);
  const scene::Image whole = forward(scene.layers(), scene.camera, {.background = background}).color;
  for (const scene::Rect region : {reach, scene::Rect{0, 0, scene.camera.width, scene.camera.height}}) {
    const FrozenView frozen(scene.only_frozen(), scene.camera, region, background);
    frame.project(scene.changeable, scene.camera);
    frame.merge(frozen);
    scene::Image picture = frozen.color();
    frame.forward(frozen, picture);
    EXPECT_TRUE(picture == part(whole, region));
  }
}

/// backward() of a frame that has drawn the scene against that of all layers.
void expect_gradients_of_all_layers(const Scene& scene, const FrozenView& frozen, LocalFrame& frame, Vec3 background) {
  const scene::Image upstream = noise(scene.camera.width, scene.camera.height);
  Gradients local, expected;
  for (Gradients* gradients : {&local, &expected}) gradients->reset(scene.changeable.size(), 1);
  frame.backward(frozen, scene.changeable, part(upstream, frozen.region()), local);

  std::vector<std::uint32_t> rows(scene.changeable.size());
  std::iota(rows.begin(), rows.end(), std::uint32_t(scene.frozen.size()));
  BackwardOptions options;
  options.forward.background = background;
  BackwardWorkspace workspace;
  backward(scene.layers(), scene.camera, options, {.color = upstream}, rows, workspace, expected);
  EXPECT_TRUE(local.mean == expected.mean);
  EXPECT_TRUE(local.log_scale == expected.log_scale);
  EXPECT_TRUE(local.rotation == expected.rotation);
  EXPECT_TRUE(local.opacity_logit == expected.opacity_logit);
  EXPECT_TRUE(local.sh == expected.sh);
  EXPECT_TRUE(local.mean2d_x_px == expected.mean2d_x_px);
  EXPECT_TRUE(local.mean2d_y_px == expected.mean2d_y_px);
  EXPECT_NE(local.opacity_logit, std::vector<float>(local.size(), 0.0f));
}

/// Draws the scene by a frame and walks it back, and compares both with all layers.
void expect_all_layers(const Scene& scene, LocalFrame& frame) {
  const Vec3 background(0.3f);
  const scene::Rect region = frame.project(scene.changeable, scene.camera);
  const FrozenView frozen(scene.only_frozen(), scene.camera, region, background);
  frame.merge(frozen);
  scene::Image picture = frozen.color();
  frame.forward(frozen, picture);
  EXPECT_TRUE(picture == part(forward(scene.layers(), scene.camera, {.background = background}).color, region));
  expect_gradients_of_all_layers(scene, frozen, frame, background);
}

TEST(FrozenView, GivesTheGradientsOfAllLayersOfAnySizeForAnyNumberOfThreads) {
  std::vector<Scene> scenes(4);
  scenes[1].changeable = random_cloud(2500, 2, 0.1f, 0.05f, 0.1f);    // of several blocks
  scenes[2].changeable = random_cloud(20'500, 2, 0.1f, 0.05f, 0.1f);  // and by groups of tiles; few of them are seen
  for (std::size_t row = 0; row < 20'500; ++row)
    if (row % 17 != 0) scenes[2].changeable.opacity_logit[row] = -30;
  // As deep as frozen ones, to the bit, several of which share a depth.
  for (std::size_t row = 0; row < scenes[3].changeable.size(); ++row)
    scenes[3].changeable.mean.set(row, scenes[3].frozen.mean.get(1000 + row / 2));
  for (const int threads : {1, 4}) {
    WorkArena arena(threads);
    arena.run([&] {
      LocalFrame frame;
      for (const std::size_t i : {0, 1, 2, 3, 0}) {
        SCOPED_TRACE(std::to_string(threads) + " threads, scene " + std::to_string(i));
        expect_all_layers(scenes[i], frame);
      }
    });
  }
}

TEST(FrozenView, ServesOnePictureAfterAnother) {
  Scene scene;
  LocalFrame reused;
  const scene::Rect all{0, 0, scene.camera.width, scene.camera.height};
  const FrozenView frozen(scene.only_frozen(), scene.camera, all);
  for (int move = 0; move < 4; ++move) {
    for (float& x : scene.changeable.mean.x) x += 0.2f;
    reused.project(scene.changeable, scene.camera);
    reused.merge(frozen);
    scene::Image picture = frozen.color();
    reused.forward(frozen, picture);
    EXPECT_TRUE(picture == forward(scene.layers(), scene.camera).color) << move;
    expect_gradients_of_all_layers(scene, frozen, reused, Vec3(0.0f));
  }
}

TEST(FrozenView, DoesNotCountWhatIsElsewhere) {
  Scene scene;
  LocalFrame frame;
  const scene::Rect region = frame.project(scene.changeable, scene.camera);
  const FrozenView alone(scene.only_frozen(), scene.camera, region);
  frame.merge(alone);
  const std::size_t entries = frame.entries();
  ASSERT_GT(entries, 0u);
  const scene::GaussianCloud elsewhere = random_cloud(40000, 9, -0.45f, -0.3f, 0.05f);
  std::vector<std::uint32_t> rows(elsewhere.size());
  std::iota(rows.begin(), rows.end(), 0u);
  scene::append_rows(scene.frozen, elsewhere, rows);
  const FrozenView crowded(scene.only_frozen(), scene.camera, region);
  frame.project(scene.changeable, scene.camera);
  frame.merge(crowded);
  EXPECT_EQ(crowded.splats(), alone.splats());
  EXPECT_EQ(frame.entries(), entries);
}

TEST(FrozenView, NothingChangeableLeavesTheFrozenPicture) {
  Scene scene;
  scene.changeable.resize(0);
  LocalFrame frame;
  EXPECT_TRUE(frame.project(scene.changeable, scene.camera).empty());
  const FrozenView frozen(scene.only_frozen(), scene.camera, {16, 32, 64, 80});
  frame.merge(frozen);
  scene::Image picture = frozen.color();
  frame.forward(frozen, picture);
  EXPECT_TRUE(picture == frozen.color());
  EXPECT_TRUE(picture == part(forward(scene.only_frozen(), scene.camera).color, {16, 32, 64, 80}));
  EXPECT_TRUE(frame.tiles().empty());
}

}  // namespace
}  // namespace engine::render
