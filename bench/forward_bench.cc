// How fast the forward pass is, on this machine and against the one CPU program of its kind.
//
//   build/release/bench/forward_bench
//
// Figures of two machines are compared through the calibrator: the bare arithmetic of blending on all cores. Each frame
// is timed next to a run of it, so that whatever else the machine does hits both.
#include <benchmark/benchmark.h>

#include <numeric>
#include <vector>

#include "bench/calibrator.h"
#include "bench/fox.h"
#include "bench/measure.h"
#include "engine/procedural/demo_scene.h"
#include "engine/render/forward.h"
#include "engine/render/reference/forward_reference.h"

namespace {

/// Pairs that this view blends, as the reference counts them.
double blended_pairs(const engine::scene::GaussianCloud& cloud, const engine::scene::Camera& camera) {
  const auto counts = engine::render::forward_reference<float>(cloud, camera, {}, {}).contributions;
  return std::accumulate(counts.begin(), counts.end(), 0.0);
}

/// Times frames next to the calibrator. Counters are medians over the frames.
void time_frames(benchmark::State& state, const engine::scene::GaussianCloud& cloud,
                 const engine::scene::Camera& camera, bool against_peer) {
  const double pairs = blended_pairs(cloud, camera);
  engine::render::Workspace workspace;
  engine::render::Rendering frame;
  std::vector<double> frame_s, calibrator_rate, share, speedup;
  for (auto _ : state) {
    const double rate = bench::calibrator_pairs_per_s();
    const auto start = bench::Clock::now();
    engine::render::forward(cloud, camera, {}, {}, workspace, frame);
    const double s = bench::seconds_since(start);
    benchmark::DoNotOptimize(frame.color.data.data());
    state.SetIterationTime(s);
    frame_s.push_back(s);
    calibrator_rate.push_back(rate);
    share.push_back(pairs / s / rate);
    speedup.push_back(bench::times_faster(bench::peer_forward_s, s, rate));
  }
  state.counters["frame_ms"] = 1e3 * bench::median(frame_s);
  state.counters["frames_per_s"] = 1 / bench::median(frame_s);
  state.counters["blended_Mpairs"] = pairs * 1e-6;
  state.counters["blended_Gpairs_per_s"] = pairs / bench::median(frame_s) * 1e-9;
  state.counters["calibrator_Gpairs_per_s"] = bench::median(calibrator_rate) * 1e-9;
  state.counters["share_of_calibrator"] = bench::median(share);
  if (against_peer) state.counters["times_faster_than_peer"] = bench::median(speedup);
}

void calibrator(benchmark::State& state) {
  double pairs = 0;
  for (auto _ : state) pairs += double(bench::blend_in_registers(1'000'000));
  state.counters["Gpairs_per_s"] = benchmark::Counter(pairs * 1e-9, benchmark::Counter::kIsRate);
}
BENCHMARK(calibrator)->UseRealTime()->Unit(benchmark::kMillisecond);

void fox_view_0001_359x640(benchmark::State& state) {
  const auto fox = bench::fox("0001.jpg");
  if (!fox) return state.SkipWithError(bench::no_fox);
  time_frames(state, fox->cloud, fox->camera, true);
}
BENCHMARK(fox_view_0001_359x640)->UseManualTime()->Unit(benchmark::kMillisecond)->Iterations(60);

void demo_scene_1280x720(benchmark::State& state) {
  const auto scene = engine::procedural::make_demo_scene(
      {.gaussians = std::size_t(state.range(0)), .seed = 0, .views = 40, .width = 1280, .height = 720});
  time_frames(state, scene.cloud, scene.cameras.front(), false);
}
BENCHMARK(demo_scene_1280x720)
    ->Arg(150'000)
    ->Arg(1'000'000)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond)
    ->Iterations(20);

}  // namespace

BENCHMARK_MAIN();
