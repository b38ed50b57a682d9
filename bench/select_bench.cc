// How long growing a selection takes, by the Gaussians that it looks at.
//
//   build/release/bench/select_bench
//
// The ball of the demo scene, with two points on it and three around it, in scenes of 100,000 and a million Gaussians;
// the reach is large enough to look at about as many as named; of a million, a tenth are nodes. On one thread and on
// two.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/procedural/demo_scene.h"
#include "engine/select/neighbourhood.h"

namespace {

namespace select = engine::select;
using engine::DVec3;

/// Points on the ball, and on the table and the wall around it.
select::Grow points_on_ball(const engine::procedural::DemoScene& demo) {
  const engine::procedural::SuggestedDrag::Handle& ball = demo.drags[0].handles[0];
  const double radius = ball.radius / 1.04;  // the handle's holds all of it
  const DVec3 foot = ball.source + DVec3(0, radius, 0);
  return {
      {ball.source + radius * DVec3(0.6, 0, -0.8), ball.source + radius * DVec3(-0.6, 0, -0.8)},
      {foot + radius * DVec3(1.3, 0, -0.5), foot + radius * DVec3(-1.3, 0, -0.5), foot + radius * DVec3(0, 0, -1.5)},
      6.0};
}

/// The demo scene of so many Gaussians, made once. Its rows come in no order, as those of a trained scene.
const engine::procedural::DemoScene& scene_of(std::size_t gaussians) {
  static engine::procedural::DemoScene demo;
  static std::size_t made = 0;
  if (made == gaussians) return demo;
  demo = engine::procedural::make_demo_scene({.gaussians = gaussians, .views = 5});
  std::vector<std::uint32_t> rows(demo.cloud.size());
  std::iota(rows.begin(), rows.end(), 0u);
  engine::Rng rng(1);
  for (std::size_t left = rows.size(); left > 1; --left)
    std::swap(rows[left - 1], rows[std::min(left - 1, std::size_t(rng.uniform() * float(left)))]);
  engine::scene::GaussianCloud shuffled;
  shuffled.sh_degree = demo.cloud.sh_degree;
  engine::scene::append_rows(shuffled, demo.cloud, rows);
  demo.cloud = std::move(shuffled);
  made = gaussians;
  return demo;
}

/// The first click: neighbours are looked for, then cut apart.
void grow_first(benchmark::State& state) {
  const engine::procedural::DemoScene& demo = scene_of(std::size_t(state.range(0)));
  const select::Grow grow = points_on_ball(demo);
  engine::WorkArena arena(int(state.range(1)));
  arena.run([&] {
    std::size_t selected = 0, looked_at = 0;
    for (auto _ : state) {
      const select::Neighbourhood around(demo.cloud, select::surroundings_of(demo.cloud.mean, grow));
      selected = around.grow(demo.cloud, grow).value().rows.size();
      looked_at = around.size();
    }
    state.counters["selected"] = double(selected);
    state.counters["looked_at"] = double(looked_at);
  });
}

/// The next one: cut apart anew.
void grow_again(benchmark::State& state) {
  const engine::procedural::DemoScene& demo = scene_of(std::size_t(state.range(0)));
  const select::Grow grow = points_on_ball(demo);
  engine::WorkArena arena(int(state.range(1)));
  arena.run([&] {
    const select::Neighbourhood around(demo.cloud, select::surroundings_of(demo.cloud.mean, grow));
    for (auto _ : state) benchmark::DoNotOptimize(around.grow(demo.cloud, grow));
  });
}

void sizes_and_threads(benchmark::internal::Benchmark* bench) {
  bench->ArgNames({"gaussians", "threads"})->Unit(benchmark::kMillisecond)->UseRealTime();
  for (const int gaussians : {100'000, 1'000'000})
    for (const int threads : {1, 2}) bench->Args({gaussians, threads});
}
BENCHMARK(grow_first)->Apply(sizes_and_threads);
BENCHMARK(grow_again)->Apply(sizes_and_threads);

}  // namespace

BENCHMARK_MAIN();
