// How long the corrector `scene` takes for a picture, by the share of it that is to be made anew.
//
//   build/release/bench/correct_bench
//
// Pictures of the demo scene at 512x384, on one thread; six examples to learn from, as in an edit.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/correct/scene_corrector.h"
#include "engine/procedural/demo_scene.h"
#include "engine/render/forward.h"

namespace {

namespace correct = engine::correct;
namespace scene = engine::scene;

constexpr int width = 512, height = 384;

/// A square in the middle of a picture.
scene::Rect square(double share) {
  const int side = int(std::sqrt(share * width * height));
  return {(width - side) / 2, (height - side) / 2, (width + side) / 2, (height + side) / 2};
}

/// Pictures all around, in which the edit is in the middle as well.
std::vector<correct::Example> demo_pictures(double share) {
  const engine::procedural::DemoScene demo =
      engine::procedural::make_demo_scene({.gaussians = 60000, .views = 7, .width = width, .height = height});
  std::vector<correct::Example> pictures;
  for (const scene::Camera& view : demo.cameras)
    pictures.push_back({engine::render::forward(demo.cloud, view).color, scene::Mask(width, height), square(share)});
  return pictures;
}

/// The square shows nothing.
correct::CorrectionTask flawed(const scene::Image& picture, double share) {
  correct::CorrectionTask out{picture, scene::Mask(width, height), scene::Image(width, height, 1), {}};
  std::fill(out.trust.data.begin(), out.trust.data.end(), 1.0f);
  const scene::Rect part = square(share);
  for (int y = part.y0; y < part.y1; ++y)
    for (int x = part.x0; x < part.x1; ++x) {
      out.mask.at(x, y) = 1;
      out.trust.at(x, y) = 0;
      for (int c = 0; c < 3; ++c) out.picture.at(x, y, c) = 0;
    }
  return out;
}

/// Argument: percent of the picture.
void correct_512x384(benchmark::State& state) {
  engine::WorkArena one(1);
  one.run([&] {
    const double share = double(state.range(0)) / 100;
    std::vector<correct::Example> examples = demo_pictures(share);
    correct::CorrectionTask view = flawed(examples.back().picture, share);
    examples.pop_back();
    view.examples.resize(examples.size());
    std::iota(view.examples.begin(), view.examples.end(), std::size_t{0});
    correct::SceneCorrector corrector;
    if (!corrector.fine_tune(examples, 0)) return state.SkipWithError("no buffer");
    for (auto _ : state) benchmark::DoNotOptimize(corrector.correct(std::span(&view, 1), 0.5, 7));
  });
}
BENCHMARK(correct_512x384)
    ->ArgName("percent_made_anew")
    ->Arg(1)
    ->Arg(5)
    ->Arg(20)
    ->Unit(benchmark::kMillisecond)
    ->Iterations(3);

}  // namespace

BENCHMARK_MAIN();
