// What an iteration of an edit's optimisation costs, and that it does not go with what is outside the edited tiles.
//
//   build/release/bench/edit_iteration_bench
//
// The fox's ear in one view of 512 pixels, towards a picture in which it is a little brighter. Argument: how many times
// as many Gaussians there are as in the capture, all additional ones visible, but outside the region of the edit.
// "setup" is what a view costs once per interval.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "engine/core/rng.h"
#include "engine/io/dataset.h"
#include "engine/io/scene_file.h"
#include "engine/mask/mask.h"
#include "engine/render/forward.h"
#include "engine/train/trainer.h"

namespace {

namespace scene = engine::scene;
namespace train = engine::train;
using engine::DVec3;

std::filesystem::path fox() {
  const char* data = std::getenv("SPLATDRAG_DATA");
  return (data ? std::filesystem::path(data) : std::filesystem::path(SPLATDRAG_SOURCE_DIR) / "../shared/data") / "fox";
}

std::vector<std::uint32_t> ear(const scene::GaussianCloud& cloud) {
  std::vector<std::uint32_t> rows;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const DVec3 mean(cloud.mean.get(i));
    for (const DVec3 handle : {DVec3(2.50, -1.46, 1.60), DVec3(2.36, -1.28, 1.68), DVec3(2.24, -0.88, 1.93)})
      if (glm::distance(mean, handle) < 0.3) {
        rows.push_back(std::uint32_t(i));
        break;
      }
  }
  return rows;
}

/// Pixels that the rows dominate, dilated.
scene::Mask mask_of(const scene::GaussianCloud& cloud, const std::vector<std::uint32_t>& rows,
                    const scene::Camera& camera) {
  std::vector<float> weight(cloud.size(), 0.0f);
  for (const std::uint32_t row : rows) weight[row] = 1;
  const auto share = engine::render::forward(cloud, camera, {.color = false}, weight).weight;
  return engine::mask::dilate(engine::mask::mask2d(share), engine::mask::dilation_radius(camera.height));
}

/// Adds small Gaussians until there are `count`: copies of those that are visible well outside `region`, a little
/// aside.
void crowd(scene::GaussianCloud& cloud, std::size_t count, const scene::Camera& camera, scene::Rect region) {
  std::vector<std::uint32_t> outside;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const DVec3 p = camera.cam_from_world(DVec3(cloud.mean.get(i)));
    if (p.z < 1) continue;
    const engine::DVec2 pixel = camera.pixel_from_cam(p);
    const bool visible = pixel.x >= 0 && pixel.y >= 0 && pixel.x < camera.width && pixel.y < camera.height;
    const bool near =
        pixel.x > region.x0 - 16 && pixel.x < region.x1 + 16 && pixel.y > region.y0 - 16 && pixel.y < region.y1 + 16;
    if (visible && !near) outside.push_back(std::uint32_t(i));
  }
  engine::Rng rng(3);
  const scene::GaussianCloud from = cloud;
  while (cloud.size() < count && !outside.empty()) {
    const std::size_t first = cloud.size();
    const std::size_t n = std::min(outside.size(), count - first);
    scene::append_rows(cloud, from, std::span(outside).first(n));
    for (std::size_t i = first; i < cloud.size(); ++i) {
      cloud.mean.set(i, cloud.mean.get(i) + 0.002f * engine::Vec3(rng.normal(), rng.normal(), rng.normal()));
      cloud.log_scale.set(i, engine::Vec3(-6));  // a pixel or two
    }
  }
}

void fox_ear_512(benchmark::State& state) {
  auto file = engine::io::read_scene(fox() / "point_cloud.ply");
  const auto dataset = engine::io::read_dataset(fox());
  if (!file || !dataset) return state.SkipWithError("the fox capture is not on this machine (SPLATDRAG_DATA)");
  const auto view = std::find_if(dataset->views.begin(), dataset->views.end(),
                                 [](const auto& v) { return v.camera.name == "0097.jpg"; });
  if (view == dataset->views.end()) return state.SkipWithError("view 0097.jpg is missing");
  const scene::Camera camera = scene::fit_within(view->camera, 512);
  scene::GaussianCloud& cloud = file->cloud;
  const std::vector<std::uint32_t> rows = ear(cloud);
  const scene::Mask mask = mask_of(cloud, rows, camera);
  train::Changeable changeable;
  changeable.cloud.sh_degree = cloud.sh_degree, changeable.cloud.extra_stride = cloud.extra_stride;
  scene::append_rows(changeable.cloud, cloud, rows);
  engine::render::LocalFrame frame;
  const scene::Rect region = train::region_around(
      train::united(engine::mask::bounding_box(mask), frame.project(changeable.cloud, camera)), camera);
  crowd(cloud, cloud.size() * std::size_t(state.range(0)), camera, region);

  engine::optim::MsSsimLoss loss;
  train::TrainOptions options;
  options.densify.every = 0;
  train::Trainer trainer({&cloud, rows}, changeable, 1, options, loss);
  const auto before = std::chrono::steady_clock::now();
  trainer.add_view(camera, mask, changeable.cloud);
  const std::chrono::duration<double, std::milli> setup = std::chrono::steady_clock::now() - before;
  scene::Image target = trainer.render(0);
  for (float& value : target.data) value = 0.9f * value + 0.1f;
  trainer.set_edited(0, std::move(target));
  trainer.begin_correction({}, 1'000'000);
  for (auto _ : state)
    if (!trainer.step()) return state.SkipWithError("the optimisation failed");
  state.counters["gaussians"] = double(cloud.size());
  state.counters["changeable"] = double(rows.size());
  state.counters["tiles"] = double(trainer.last_cost().tiles);
  state.counters["entries"] = double(trainer.last_cost().entries);
  state.counters["setup_ms"] = setup.count();
}

BENCHMARK(fox_ear_512)->Arg(1)->Arg(2)->Arg(5)->Arg(10)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace

BENCHMARK_MAIN();
