#include "engine/render/layers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/render/forward.h"
#include "engine/render/reference/forward_reference.h"
#include "tests/engine/scene/random_overlay.h"

namespace engine::render {
namespace {

scene::Camera test_camera() {
  scene::Camera camera = scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1.0, 90, 70);
  camera.cx += 3.3;
  return camera;
}

/// Gaussians in front of the camera, no two at the same depth.
scene::GaussianCloud random_cloud(std::size_t n, std::uint64_t seed, int degree = 2) {
  scene::GaussianCloud cloud;
  cloud.sh_degree = degree;
  cloud.resize(n);
  Rng rng(seed, 3);
  for (std::size_t i = 0; i < n; ++i) {
    const float z = rng.uniform(0.5f, 6.0f);
    cloud.mean.set(i, {z * rng.uniform(-0.9f, 0.9f), z * rng.uniform(-0.7f, 0.7f), z});
    cloud.log_scale.set(i, {rng.uniform(-5.0f, -1.0f), rng.uniform(-5.0f, -1.0f), rng.uniform(-5.0f, -1.0f)});
    cloud.rotation.set(i, {rng.normal(), rng.normal(), rng.normal(), rng.normal()});
    cloud.opacity_logit[i] = rng.uniform(-4.0f, 4.0f);
  }
  for (float& value : cloud.sh) value = 0.4f * rng.normal();
  return cloud;
}

scene::LayeredCloud random_version(std::size_t base_rows, std::size_t added, std::uint64_t seed) {
  auto base = std::make_shared<scene::GaussianCloud>(random_cloud(base_rows, seed));
  auto overlay = std::make_shared<scene::Overlay>(scene::random_overlay(
      base_rows, added, seed, [](std::size_t n, std::uint64_t s) { return random_cloud(n, s + 1000); }));
  return {base, overlay};
}

/// Weights of the layers' rows, hidden ones included, from those of the merged rows.
std::vector<float> layer_weights(const Layers& layers, std::span<const float> merged) {
  std::vector<float> weights(layers.size(), 1e9f);  // what is hidden must not show
  for (std::size_t row = 0; row < weights.size(); ++row)
    if (!std::binary_search(layers.hidden.begin(), layers.hidden.end(), row))
      weights[row] = merged[layers.merged_row(row)];
  return weights;
}

void expect_same(const Rendering& a, const Rendering& b) {
  EXPECT_TRUE(a.color == b.color);
  EXPECT_TRUE(a.alpha == b.alpha);
  EXPECT_TRUE(a.depth == b.depth);
  EXPECT_TRUE(a.median_depth == b.median_depth);
  EXPECT_TRUE(a.weight == b.weight);
}

TEST(Layers, RenderTheBytesOfTheMergedCloud) {
  const struct {
    std::size_t base, added;
  } sizes[] = {{0, 0}, {0, 40}, {1, 0}, {300, 0}, {300, 77}, {1024, 1024}, {3000, 700}};
  Workspace workspace;  // one for all: what an earlier scene left in it must not show
  for (const auto& [base, added] : sizes)
    for (const Backend backend : {Backend::simd, Backend::reference}) {
      SCOPED_TRACE(::testing::Message() << base << " + " << added << (backend == Backend::simd ? " simd" : " scalar"));
      if (backend == Backend::reference && base > 1024) continue;  // slow, and nothing new
      const DrawnVersion drawn(random_version(base, added, base + added));
      const Layers layers = drawn.layers();
      const scene::GaussianCloud merged = scene::flatten(drawn.version());
      std::vector<float> weight(merged.size());
      for (std::size_t i = 0; i < weight.size(); ++i) weight[i] = float(i % 7);
      const auto weights = layer_weights(layers, weight);
      std::vector<ForwardOptions> variants(5, {.background = {0.1f, 0.5f, 0.9f}, .depth = true, .backend = backend});
      variants[1].rect = scene::Rect{13, 7, 50, 49};
      variants[2].tiles = {0, 3, 7, 14};
      variants[3].color = false;
      variants[4].max_sh_degree = 0;
      for (const ForwardOptions& options : variants) {
        expect_same(forward(layers, test_camera(), options), forward(merged, test_camera(), options));
        Rendering seen;
        forward(layers, test_camera(), options, weights, workspace, seen);
        expect_same(seen, forward(merged, test_camera(), options, weight));
      }
    }
}

TEST(Layers, OfAPlainVersionAreTheBase) {
  const auto base = std::make_shared<scene::GaussianCloud>(random_cloud(100, 1));
  const DrawnVersion drawn({base, nullptr});
  EXPECT_EQ(drawn.layers().size(), 100u);
  EXPECT_EQ(drawn.layers().merged_row(99), 99u);
  expect_same(forward(drawn.layers(), test_camera()), forward(*base, test_camera()));
}

TEST(Layers, KnowTheNumbersOfTheMergedRows) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const DrawnVersion drawn(random_version(60, seed % 5, seed));
    const Layers layers = drawn.layers();
    const scene::GaussianCloud merged = scene::flatten(drawn.version());
    std::size_t drawn_rows = 0;
    for (std::size_t row = 0; row < layers.size(); ++row) {
      if (std::binary_search(layers.hidden.begin(), layers.hidden.end(), row)) continue;
      ++drawn_rows;
      const bool on_top = row >= layers.base->size();
      const Vec3 mean = on_top ? layers.top->mean.get(row - layers.base->size()) : layers.base->mean.get(row);
      ASSERT_LT(layers.merged_row(row), merged.size()) << seed << ": " << row;
      EXPECT_EQ(merged.mean.get(layers.merged_row(row)), mean) << seed << ": " << row;
    }
    EXPECT_EQ(drawn_rows, merged.size());
  }
}

TEST(Layers, KeepTheirVersionInMemory) {
  std::unique_ptr<DrawnVersion> drawn;
  scene::GaussianCloud merged;
  {
    const scene::LayeredCloud version = random_version(200, 10, 4);
    merged = scene::flatten(version);
    drawn = std::make_unique<DrawnVersion>(version);
  }
  const DrawnVersion moved = std::move(*drawn);
  expect_same(forward(moved.layers(), test_camera()), forward(merged, test_camera()));
}

TEST(Layers, RenderTheSameBytesForAnyNumberOfThreads) {
  const DrawnVersion drawn(random_version(5000, 2000, 5));
  const auto alone = forward(drawn.layers(), test_camera(), {.depth = true});
  for (const int threads : {1, 2, 4})
    WorkArena(threads).run([&] { expect_same(forward(drawn.layers(), test_camera(), {.depth = true}), alone); });
}

}  // namespace
}  // namespace engine::render
