// What an edit's optimisation costs: an iteration against the size of the edited region and of all that is outside of
// it, and whole edits.
//
//   build/release/bench/edit_cost docs
//
// writes docs/edit-cost.md and docs/edit-cost.svg. On the demo scene, and on the fox capture where it is at hand
// (SPLATDRAG_DATA). Takes some minutes, and wants the machine to itself.
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "bench/fox.h"
#include "bench/measure.h"
#include "bench/process.h"
#include "bench/svg_plot.h"
#include "engine/core/rng.h"
#include "engine/edit/edit.h"
#include "engine/mask/mask.h"
#include "engine/procedural/demo_scene.h"
#include "engine/render/forward.h"
#include "engine/train/trainer.h"

namespace {

namespace edit = engine::edit;
namespace scene = engine::scene;
namespace train = engine::train;
using engine::DVec3;

// Scenes and edits ---------------------------------------------------------------------------------------------------

/// A scene, and a drag of it as one would ask for it.
struct Sample {
  scene::GaussianCloud cloud;
  std::vector<scene::Camera> cameras;
  scene::Camera camera;  ///< That sees the dragged part.
  edit::Request request;
};

Sample demo_sample(std::size_t gaussians) {
  auto demo = engine::procedural::make_demo_scene({.gaussians = gaussians});
  Sample sample{std::move(demo.cloud), std::move(demo.cameras), {}, {}};
  sample.camera = sample.cameras.front();
  for (const auto& handle : demo.drags.front().handles)
    sample.request.handles.push_back({handle.source, handle.target, handle.radius, 0});
  return sample;
}

/// The drag of the left ear that comes with the capture.
std::optional<Sample> fox_sample() {
  auto fox = bench::fox("0097.jpg");
  if (!fox) return std::nullopt;
  Sample sample{std::move(fox->cloud), std::move(fox->cameras), fox->camera, {}};
  sample.request.handles = {{DVec3(2.50, -1.46, 1.60), DVec3(2.56, -1.96, 1.62), 0.3, 0},
                            {DVec3(2.36, -1.28, 1.68), DVec3(2.39, -1.53, 1.69), 0.3, 0},
                            {DVec3(2.24, -0.88, 1.93), std::nullopt, 0.3, 0}};
  return sample;
}

/// The `count` rows nearest to the first handle.
std::vector<std::uint32_t> nearest_rows(const Sample& sample, std::size_t count) {
  const DVec3 centre = sample.request.handles.front().source;
  std::vector<std::uint32_t> rows(sample.cloud.size());
  std::iota(rows.begin(), rows.end(), 0u);
  const auto distance = [&](std::uint32_t row) { return glm::distance(centre, DVec3(sample.cloud.mean.get(row))); };
  std::nth_element(rows.begin(), rows.begin() + std::ptrdiff_t(count), rows.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return distance(a) < distance(b); });
  rows.resize(count);
  std::sort(rows.begin(), rows.end());
  return rows;
}

/// The rows that its handles hold.
std::vector<std::uint32_t> held_rows(const Sample& sample) {
  std::vector<std::uint32_t> rows;
  for (std::size_t i = 0; i < sample.cloud.size(); ++i)
    for (const edit::Handle& handle : sample.request.handles)
      if (glm::distance(DVec3(sample.cloud.mean.get(i)), handle.source) < handle.radius) {
        rows.push_back(std::uint32_t(i));
        break;
      }
  return rows;
}

// Iterations ---------------------------------------------------------------------------------------------------------

/// Pixels that the rows dominate, dilated.
scene::Mask mask_of(const scene::GaussianCloud& cloud, const std::vector<std::uint32_t>& rows,
                    const scene::Camera& camera) {
  std::vector<float> weight(cloud.size(), 0.0f);
  for (const std::uint32_t row : rows) weight[row] = 1;
  const auto share = engine::render::forward(cloud, camera, {.color = false}, weight).weight;
  return engine::mask::dilate(engine::mask::mask2d(share), engine::mask::dilation_radius(camera.height));
}

/// A training of some rows in one view, towards a picture in which they are a little brighter.
class Training {
 public:
  Training(scene::GaussianCloud cloud, std::vector<std::uint32_t> rows, const scene::Camera& camera,
           const scene::Mask& mask)
      : cloud_(std::move(cloud)), rows_(std::move(rows)) {
    train::TrainedRows changeable;
    changeable.cloud.sh_degree = cloud_.sh_degree, changeable.cloud.extra_stride = cloud_.extra_stride;
    scene::append_rows(changeable.cloud, cloud_, rows_);
    const scene::GaussianCloud original = changeable.cloud;
    train::TrainOptions options;
    options.densify.every = 0;  // the size is what is measured
    trainer_.emplace(train::FrozenScene{&cloud_, rows_}, std::move(changeable), 1, options, loss_);
    const auto start = bench::Clock::now();
    if (!trainer_->add_view(camera, mask, original)) throw std::runtime_error("the view shows nothing of the edit");
    setup_ms_ = 1e3 * bench::seconds_since(start);
    scene::Image target = trainer_->render(0);
    for (float& value : target.data) value = 0.9f * value + 0.1f;
    trainer_->set_edited(0, std::move(target));
    trainer_->begin_correction({}, 1'000'000);
  }

  void step() {
    const auto start = bench::Clock::now();
    if (!trainer_->step()) throw std::runtime_error("an iteration failed");
    times_ms_.push_back(1e3 * bench::seconds_since(start));
  }
  void warm_up() {
    for (int i = 0; i < 20; ++i) step();
    times_ms_.clear();
  }

  [[nodiscard]] double median_ms() const { return bench::median(times_ms_); }
  [[nodiscard]] double setup_ms() const { return setup_ms_; }
  [[nodiscard]] const train::IterationCost& cost() const { return trainer_->last_cost(); }
  [[nodiscard]] std::size_t gaussians() const { return cloud_.size(); }

 private:
  scene::GaussianCloud cloud_;
  std::vector<std::uint32_t> rows_;
  engine::optim::MsSsimLoss loss_;
  std::optional<train::Trainer> trainer_;
  double setup_ms_ = 0;
  std::vector<double> times_ms_;
};

struct IterationCost {
  std::size_t changeable = 0, tiles = 0, entries = 0;
  double ms = 0, setup_ms = 0;
};

IterationCost measure_iteration(const Sample& sample, std::size_t changeable) {
  const scene::Camera camera = scene::fit_within(sample.camera, 512);
  const auto rows = nearest_rows(sample, changeable);
  Training training(sample.cloud, rows, camera, mask_of(sample.cloud, rows, camera));
  training.warm_up();
  for (int i = 0; i < 150; ++i) training.step();
  return {changeable, training.cost().tiles, training.cost().entries, training.median_ms(), training.setup_ms()};
}

/// Adds Gaussians of a pixel or two until there are `count`: beside those that are visible well outside the region.
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
  if (outside.empty()) throw std::runtime_error("the edit covers the whole picture");
  engine::Rng rng(3);
  const scene::GaussianCloud from = cloud;
  while (cloud.size() < count) {
    const std::size_t first = cloud.size();
    scene::append_rows(cloud, from, std::span(outside).first(std::min(outside.size(), count - first)));
    for (std::size_t i = first; i < cloud.size(); ++i) {
      cloud.mean.set(i, cloud.mean.get(i) + 0.002f * engine::Vec3(rng.normal(), rng.normal(), rng.normal()));
      cloud.log_scale.set(i, engine::Vec3(-6));
    }
  }
}

constexpr std::array<int, 4> crowds{1, 2, 5, 10};
struct Crowded {
  std::size_t changeable = 0;
  std::array<std::size_t, crowds.size()> gaussians{};
  std::array<double, crowds.size()> ms{}, setup_ms{};
};

/// The dragged part amid more and more Gaussians elsewhere. The trainings take turns, in random order, so that whatever
/// else the machine does hits all of them.
Crowded measure_crowds(const Sample& sample) {
  const scene::Camera camera = scene::fit_within(sample.camera, 512);
  const auto rows = held_rows(sample);
  const scene::Mask mask = mask_of(sample.cloud, rows, camera);
  scene::GaussianCloud held;
  held.sh_degree = sample.cloud.sh_degree, held.extra_stride = sample.cloud.extra_stride;
  scene::append_rows(held, sample.cloud, rows);
  engine::render::LocalFrame frame;
  const scene::Rect region =
      train::region_around(train::union_of(scene::bounding_box(mask), frame.project(held, camera)), camera);
  std::vector<std::unique_ptr<Training>> trainings;
  for (const int times : crowds) {
    scene::GaussianCloud cloud = sample.cloud;
    crowd(cloud, cloud.size() * std::size_t(times), camera, region);
    trainings.push_back(std::make_unique<Training>(std::move(cloud), rows, camera, mask));
  }
  for (const auto& training : trainings) training->warm_up();
  std::array<std::size_t, crowds.size()> order;
  std::iota(order.begin(), order.end(), std::size_t{0});
  engine::Rng rng(5);
  for (int i = 0; i < 300; ++i) {
    for (std::size_t k = order.size(); k > 1; --k) std::swap(order[k - 1], order[rng.below(std::uint32_t(k))]);
    for (const std::size_t k : order) trainings[k]->step();
  }
  Crowded out;
  out.changeable = rows.size();
  for (std::size_t k = 0; k < crowds.size(); ++k) {
    out.gaussians[k] = trainings[k]->gaussians();
    out.ms[k] = trainings[k]->median_ms();
    out.setup_ms[k] = trainings[k]->setup_ms();
  }
  return out;
}

// Whole edits --------------------------------------------------------------------------------------------------------

struct EditCost {
  std::size_t gaussians = 0, changeable = 0, views = 0;
  int iterations = 0;
  double seconds = 0, views_s = 0, masks_s = 0, optimise_s = 0;
  double peak_mb = 0;  ///< Beyond what the scene takes.
};

/// 4,000 iterations: 2 intervals of 4 corrections of 500, the released code's default, in up to 50 views.
EditCost measure_edit(Sample sample, int max_image_side) {
  edit::Params& params = sample.request.params;
  params.intervals = 2, params.annealing_steps = 4, params.iterations = 500;
  params.views = 50, params.max_image_side = max_image_side;
  bench::reset_peak();
  const double before = bench::memory_mb("VmRSS");
  const auto start = bench::Clock::now();
  const auto outcome = edit::run(sample.cloud, sample.cameras, sample.request);
  EditCost cost;
  cost.seconds = bench::seconds_since(start);
  if (!outcome) throw std::runtime_error(outcome.error().message);
  cost.peak_mb = std::max(0.0, bench::memory_mb("VmHWM") - before);
  cost.gaussians = sample.cloud.size(), cost.changeable = outcome->report.changeable;
  cost.views = outcome->views.size();
  cost.iterations = params.intervals * params.annealing_steps * params.iterations;
  for (const edit::StageTime& time : outcome->report.times) {
    if (time.stage == edit::Stage::views) cost.views_s = time.seconds;
    if (time.stage == edit::Stage::mask) cost.masks_s = time.seconds;
    if (time.stage == edit::Stage::set_up || time.stage == edit::Stage::optimise) cost.optimise_s += time.seconds;
  }
  return cost;
}

// The page -----------------------------------------------------------------------------------------------------------

template <class... Values>
std::string line(const char* format, Values... values) {
  char text[400];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

std::string row(const IterationCost& cost) {
  return line("| %zu | %zu | %zu | %.2f | %.1f |\n", cost.changeable, cost.tiles, cost.entries, cost.ms, cost.setup_ms);
}

std::string rows(const char* what, const Crowded& crowded) {
  std::string out;
  for (std::size_t k = 0; k < crowds.size(); ++k)
    out += line("| %s, %zu dragged | %zu (%dx) | %.2f | %+.1f %% | %.1f |\n", what, crowded.changeable,
                crowded.gaussians[k], crowds[k], crowded.ms[k], 100 * (crowded.ms[k] / crowded.ms[0] - 1),
                crowded.setup_ms[k]);
  return out;
}

std::string row(const char* what, const EditCost& cost) {
  return line("| %s | %zu | %zu | %zu | %d | %.1f | %.1f | %.1f | %.1f | %.1f | %.0f |\n", what, cost.gaussians,
              cost.changeable, cost.views, cost.iterations, cost.seconds, cost.views_s, cost.masks_s, cost.optimise_s,
              1e3 * cost.optimise_s / cost.iterations, cost.peak_mb);
}

using Points = std::vector<std::pair<double, double>>;

struct Figures {
  Points by_size, by_entries, by_crowd, setup_by_crowd;
};

/// Measures iterations on a sample, and writes the rows of both tables.
Figures measure_iterations(const char* name, const Sample& sample, std::string& sizes, std::string& outside) {
  Figures figures;
  sizes += std::string("| changeable Gaussians, ") + name +
           " | tiles | entries | iteration, ms | setting up, ms |\n| --- | --- | --- | --- | --- |\n";
  for (const std::size_t n : {100u, 300u, 1000u, 3000u, 10'000u, 30'000u, 100'000u}) {
    if (n > sample.cloud.size()) continue;
    const IterationCost cost = measure_iteration(sample, n);
    sizes += row(cost);
    figures.by_size.emplace_back(double(n), cost.ms);
    figures.by_entries.emplace_back(double(cost.entries), cost.ms);
  }
  sizes += "\n";
  const Crowded crowded = measure_crowds(sample);
  outside += rows(name, crowded);
  for (std::size_t k = 0; k < crowds.size(); ++k) {
    figures.by_crowd.emplace_back(double(crowded.gaussians[k]), crowded.ms[k]);
    figures.setup_by_crowd.emplace_back(double(crowded.gaussians[k]), crowded.setup_ms[k]);
  }
  return figures;
}

void write_docs(const std::filesystem::path& folder) {
  // Children first: this process has not started any thread yet.
  std::string edits = row("demo scene, ball, 640 pixels",
                          bench::in_own_process<EditCost>([] { return measure_edit(demo_sample(150'000), 640); }));
  const bool with_fox = std::filesystem::exists(bench::fox_folder());
  if (with_fox)
    edits += row("fox capture, ear, 640 pixels",
                 bench::in_own_process<EditCost>([] { return measure_edit(fox_sample().value(), 640); }));

  std::string sizes, outside;
  const Figures demo = measure_iterations("demo scene", demo_sample(150'000), sizes, outside);
  bench::Chart by_size{"Time of an iteration", "changeable Gaussians", "ms", {{"demo scene", demo.by_size}}},
      by_entries{
          "Time of an iteration", "splats in the lists of edited tiles", "ms", {{"demo scene", demo.by_entries}}},
      by_crowd{"The same edit in larger scenes",
               "Gaussians of the scene",
               "ms",
               {{"demo scene, an iteration", demo.by_crowd}, {"demo scene, setting up a view", demo.setup_by_crowd}}};
  if (with_fox) {
    const Figures fox = measure_iterations("fox capture", fox_sample().value(), sizes, outside);
    by_size.series.push_back({"fox capture", fox.by_size});
    by_entries.series.push_back({"fox capture", fox.by_entries});
    by_crowd.series.push_back({"fox capture, an iteration", fox.by_crowd});
    by_crowd.series.push_back({"fox capture, setting up a view", fox.setup_by_crowd});
  }

  const std::string page =
      "# What optimising an edit costs\n\n" + std::to_string(std::thread::hardware_concurrency()) + " cores, " +
      engine::render::simd_target() +
      ". Made by `build/release/bench/edit_cost docs`. The demo scene has 150 k Gaussians; the fox capture\n"
      "is a real one, of 62 k.\n\n![](edit-cost.svg)\n\n"
      "## An iteration against the edited region\n\n"
      "Rendering, differentiating and stepping the Gaussians nearest to the first handle of a drag, in one view of "
      "512\n"
      "pixels; medians of 150 iterations. Tiles are those that they reach, entries the splats in the lists of these\n"
      "tiles. Setting a view up is done once per interval.\n\n" +
      sizes +
      "## An iteration against what is outside\n\n"
      "The drag's own Gaussians amid up to ten times as many others, all in view but outside the edited region. "
      "Trainings\n"
      "take turns; medians of 300 iterations.\n\n"
      "| scene | Gaussians | iteration, ms | change | setting up, ms |\n| --- | --- | --- | --- | --- |\n" +
      outside +
      "\n## Whole edits\n\n"
      "4,000 iterations, the default work of the released code: 2 intervals of 4 corrections of 500, through up to 50\n"
      "views. Reading and writing files is not counted. Memory: peak of the process beyond the scene.\n\n"
      "| drag | Gaussians | changeable | views | iterations | seconds | choosing views | masks | optimising | ms per "
      "iteration | memory, MB |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n" +
      edits;
  std::ofstream(folder / "edit-cost.md") << page;
  std::ofstream(folder / "edit-cost.svg") << bench::to_svg({by_size, by_entries, by_crowd});
  std::fputs(page.c_str(), stdout);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: edit_cost FOLDER\n");
    return 2;
  }
  try {
    write_docs(argv[1]);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
  return 0;
}
