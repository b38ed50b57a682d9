// How fast the backward pass is beside the forward pass of the same view, on this machine and against the one CPU
// program that differentiates, too.
//
//   build/release/bench/backward_bench
//
// Figures of two machines are compared through the calibrator (see forward_bench.cc), which runs next to each frame.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "bench/fox.h"
#include "bench/measure.h"
#include "engine/core/rng.h"
#include "engine/render/backward.h"
#include "engine/render/forward.h"
#include "engine/render/frame.h"

namespace {

namespace render = engine::render;

/// The rows nearest to one of the cloud's means: what an edit of that size may change.
std::vector<std::uint32_t> nearest_rows(const engine::scene::GaussianCloud& cloud, double part) {
  const engine::Vec3 centre = cloud.mean.get(1000);
  std::vector<std::uint32_t> rows(cloud.size());
  std::iota(rows.begin(), rows.end(), 0u);
  const auto distance = [&](std::uint32_t row) { return glm::distance(centre, cloud.mean.get(row)); };
  std::stable_sort(rows.begin(), rows.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return distance(a) < distance(b); });
  rows.resize(std::size_t(part * double(rows.size())));
  std::sort(rows.begin(), rows.end());
  return rows;
}

/// Upstream everywhere.
engine::scene::Image random_upstream(const engine::scene::Camera& camera) {
  engine::scene::Image upstream(camera.width, camera.height, 3);
  engine::Rng rng(1);
  for (float& value : upstream.data) value = rng.normal();
  return upstream;
}

/// Times both passes next to the calibrator. Counters are medians over the frames.
template <class Forward, class Backward>
void time_both(benchmark::State& state, bool against_peer, Forward forward, Backward backward) {
  std::vector<double> forward_s, backward_s, rates, speedup;
  for (auto _ : state) {
    const double rate = bench::calibrator_pairs_per_s();
    auto start = bench::Clock::now();
    forward();
    benchmark::ClobberMemory();
    forward_s.push_back(bench::seconds_since(start));
    start = bench::Clock::now();
    backward();
    benchmark::ClobberMemory();
    backward_s.push_back(bench::seconds_since(start));
    const double both = forward_s.back() + backward_s.back();
    state.SetIterationTime(both);
    rates.push_back(rate);
    speedup.push_back(bench::times_faster(bench::peer_forward_and_backward_s, both, rate));
  }
  state.counters["forward_ms"] = 1e3 * bench::median(forward_s);
  state.counters["backward_ms"] = 1e3 * bench::median(backward_s);
  state.counters["calibrator_Gpairs_per_s"] = bench::median(rates) * 1e-9;
  if (against_peer) state.counters["times_faster_than_peer"] = bench::median(speedup);
}

/// As a fit trains: all rows change, and both passes share what they can, as the peer's do.
void fox_view_0001_359x640_all(benchmark::State& state) {
  const auto fox = bench::fox("0001.jpg");
  if (!fox) return state.SkipWithError(bench::no_fox);
  const auto upstream = random_upstream(fox->camera);
  render::Gradients gradients;
  gradients.reset(fox->cloud.size(), fox->cloud.sh_degree);
  render::Frame frame;
  engine::scene::Image color(fox->camera.width, fox->camera.height, 3);
  time_both(
      state, true, [&] { frame.forward(fox->cloud, fox->camera, {}, color); },
      [&] { frame.backward(fox->cloud, upstream, gradients); });
}
BENCHMARK(fox_view_0001_359x640_all)->UseManualTime()->Unit(benchmark::kMillisecond)->Iterations(60);

/// Each pass by itself. Argument: percent of the rows that may change.
void fox_view_0001_359x640(benchmark::State& state) {
  const auto fox = bench::fox("0001.jpg");
  if (!fox) return state.SkipWithError(bench::no_fox);
  const render::Upstream upstream{.color = random_upstream(fox->camera)};
  const auto rows = nearest_rows(fox->cloud, double(state.range(0)) / 100);
  render::Gradients gradients;
  gradients.reset(rows.size(), fox->cloud.sh_degree);
  render::BackwardWorkspace backward_workspace;
  render::Workspace forward_workspace;
  render::Rendering frame;
  time_both(
      state, false, [&] { render::forward(fox->cloud, fox->camera, {}, {}, forward_workspace, frame); },
      [&] { render::backward(fox->cloud, fox->camera, {}, upstream, rows, backward_workspace, gradients); });
}
BENCHMARK(fox_view_0001_359x640)
    ->ArgName("percent_changeable")
    ->Arg(5)
    ->Arg(100)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond)
    ->Iterations(60);

}  // namespace

BENCHMARK_MAIN();
