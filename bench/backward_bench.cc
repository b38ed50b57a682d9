// How fast the backward pass is, beside the forward pass of the same view.
//
//   build/release/bench/backward_bench
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <numeric>
#include <vector>

#include "engine/core/rng.h"
#include "engine/io/dataset.h"
#include "engine/io/scene_file.h"
#include "engine/render/backward.h"
#include "engine/render/forward.h"

namespace {

namespace render = engine::render;

std::filesystem::path fox() {
  const char* data = std::getenv("SPLATDRAG_DATA");
  return (data ? std::filesystem::path(data) : std::filesystem::path(SPLATDRAG_SOURCE_DIR) / "../shared/data") / "fox";
}

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

/// Colour upstream everywhere. Argument: percent of the rows that may change; 0: the forward pass instead.
void fox_view_0001_359x640(benchmark::State& state) {
  const auto scene = engine::io::read_scene(fox() / "point_cloud.ply");
  const auto dataset = engine::io::read_dataset(fox());
  if (!scene || !dataset) return state.SkipWithError("the fox capture is not on this machine (SPLATDRAG_DATA)");
  const auto view = std::find_if(dataset->views.begin(), dataset->views.end(),
                                 [](const auto& v) { return v.camera.name == "0001.jpg"; });
  if (view == dataset->views.end()) return state.SkipWithError("view 0001.jpg is missing");
  const engine::scene::Camera& camera = view->camera;

  render::Upstream upstream{.color = engine::scene::Image(camera.width, camera.height, 3)};
  engine::Rng rng(1);
  for (float& value : upstream.color.data) value = rng.normal();
  const auto rows = nearest_rows(scene->cloud, double(state.range(0)) / 100);
  render::Gradients gradients;
  gradients.reset(rows.size(), scene->cloud.sh_degree);
  render::BackwardWorkspace backward_workspace;
  render::Workspace forward_workspace;
  render::Rendering frame;
  for (auto _ : state) {
    if (rows.empty()) {
      render::forward(scene->cloud, camera, {}, {}, forward_workspace, frame);
    } else {
      render::backward(scene->cloud, camera, {}, upstream, rows, backward_workspace, gradients);
    }
    benchmark::ClobberMemory();
  }
}
BENCHMARK(fox_view_0001_359x640)
    ->ArgName("percent_changeable")
    ->Arg(0)
    ->Arg(5)
    ->Arg(100)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond)
    ->Iterations(40);

}  // namespace

BENCHMARK_MAIN();
