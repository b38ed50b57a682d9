// Time and peak memory of the forward pass against the number of Gaussians and of pixels, on the demo scene.
//
//   build/release/bench/forward_scaling docs
//
// writes docs/forward-scaling.md and docs/forward-scaling.svg.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <thread>

#include "bench/measure.h"
#include "bench/process.h"
#include "bench/svg_plot.h"
#include "engine/procedural/demo_scene.h"
#include "engine/render/forward.h"

namespace {

struct Measured {
  double frame_ms = 0;
  double scene_mb = 0;  // the cloud
  double pass_mb = 0;   // peak of the process during rendering, beyond what it held before
};

Measured measure(std::size_t gaussians, int width, int height) {
  auto scene = engine::procedural::make_demo_scene(
      {.gaussians = gaussians, .seed = 0, .views = 40, .width = width, .height = height});
  scene.object = {};
  Measured out;
  const auto& cloud = scene.cloud;
  out.scene_mb = double(cloud.size() * (11 + cloud.sh_stride()) * sizeof(float)) / (1 << 20);
  bench::reset_peak();
  const double before = bench::memory_mb("VmRSS");
  engine::render::Workspace workspace;
  engine::render::Rendering frame;
  std::vector<double> times;
  for (int i = 0; i < 15; ++i) {
    const auto start = bench::Clock::now();
    engine::render::forward(cloud, scene.cameras.front(), {}, {}, workspace, frame);
    times.push_back(1e3 * bench::seconds_since(start));
  }
  out.frame_ms = bench::median(times);
  out.pass_mb = std::max(0.0, bench::memory_mb("VmHWM") - before);
  return out;
}

/// In a process of its own, so that peaks do not add up.
Measured measured_apart(std::size_t gaussians, int width, int height) {
  return bench::in_own_process<Measured>([&] { return measure(gaussians, width, height); });
}

std::string row(const std::string& what, const Measured& m) {
  char text[160];
  std::snprintf(text, sizeof text, "| %s | %.1f | %.0f | %.0f |\n", what.c_str(), m.frame_ms, m.scene_mb, m.pass_mb);
  return text;
}

}  // namespace

// NOLINTNEXTLINE(bugprone-exception-escape): it ends a benchmark, with its message
int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: forward_scaling FOLDER\n");
    return 2;
  }
  const std::filesystem::path folder = argv[1];
  bench::Series time_n{"frame, 1280 x 720", {}}, memory_n{"forward pass", {}}, scene_n{"the scene itself", {}};
  bench::Series time_p{"150 k Gaussians", {}}, memory_p{"forward pass", {}};
  std::string table =
      "# Forward pass: cost against size\n\nDemo scene, first view, median of 15 frames, " +
      std::to_string(std::thread::hardware_concurrency()) +
      " cores. Made by `build/release/bench/forward_scaling docs`.\nMemory: peak of the process during "
      "rendering beyond what it held before, pictures included.\n\n![](forward-scaling.svg)\n\n"
      "| Gaussians at 1280 x 720 | frame, ms | scene, MB | forward pass, MB |\n| --- | --- | --- | --- |\n";
  for (const std::size_t n : {10'000u, 30'000u, 100'000u, 300'000u, 1'000'000u, 3'000'000u}) {
    const Measured m = measured_apart(n, 1280, 720);
    table += row(std::to_string(n), m);
    time_n.points.emplace_back(double(n), m.frame_ms);
    memory_n.points.emplace_back(double(n), std::max(m.pass_mb, 1.0));
    scene_n.points.emplace_back(double(n), m.scene_mb);
  }
  table += "\n| picture, 150 k Gaussians | frame, ms | scene, MB | forward pass, MB |\n| --- | --- | --- | --- |\n";
  for (const auto& [width, height] :
       {std::pair{160, 90}, {320, 180}, {640, 360}, {1280, 720}, {1920, 1080}, {3840, 2160}}) {
    const Measured m = measured_apart(150'000, width, height);
    table += row(std::to_string(width) + " x " + std::to_string(height), m);
    const double pixels = double(width) * height;
    time_p.points.emplace_back(pixels, m.frame_ms);
    memory_p.points.emplace_back(pixels, std::max(m.pass_mb, 1.0));
  }
  std::ofstream(folder / "forward-scaling.md") << table;
  std::ofstream(folder / "forward-scaling.svg")
      << bench::to_svg({{"Time of a frame", "Gaussians", "ms", {time_n}},
                        {"Peak memory", "Gaussians", "MB", {memory_n, scene_n}},
                        {"Time of a frame", "pixels", "ms", {time_p}},
                        {"Peak memory", "pixels", "MB", {memory_p}}});
  std::fputs(table.c_str(), stdout);
}
