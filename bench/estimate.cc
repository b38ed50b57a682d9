// How good the estimate of an edit is, and the time left that a running one tells: edits of many kinds are estimated
// and carried out by the service, as its users do it, over and over.
//
//   build/release/bench/estimate docs
//
// writes docs/estimates.md. On the demo scene, and on the fox capture where it is at hand (SPLATDRAG_DATA). Takes some
// minutes, and wants the machine to itself.
//
//   build/release/bench/estimate --stages [--only NAME] [--runs N]
//
// prints, of each edit, what its plan expects of each stage beside what that has taken.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "bench/fox.h"
#include "bench/measure.h"
#include "engine/edit/preview.h"
#include "engine/edit/workload.h"
#include "engine/io/scene_file.h"
#include "engine/procedural/demo_scene.h"
#include "engine/render/forward.h"
#include "server/cli/capture_files.h"
#include "server/cli/suggested_drag.h"
#include "server/edits/convert.h"
#include "server/edits/convert_selection.h"
#include "server/edits/edit_service.h"
#include "server/edits/estimate.h"

namespace {

namespace edits = server::edits;
namespace io = engine::io;
using proto::EditRequest;
using proto::Preset;
using std::filesystem::path;

constexpr int pictured_views = 4;  // the service's default
constexpr auto look_every = std::chrono::milliseconds(20);
// Of the time left, seconds: it is rounded to a tenth, told every tenth, and looked at every `look_every`.
constexpr double resolution = 0.05 + 0.1 + 0.02;
constexpr double aim = 1.5;     // the factor that a figure should stay within
constexpr double shortest = 2;  // seconds: of a shorter edit, the resolution is most of what could be off
constexpr std::array<double, 3> moments{0.1, 0.25, 0.5};  // of an edit's time, at which the time left is judged

template <class T>
T value(engine::Result<T> result) {
  if (!result) throw std::runtime_error(result.error().message + " (" + result.error().where + ")");
  return std::move(*result);
}
void succeed(const engine::Result<void>& result) {
  if (!result) throw std::runtime_error(result.error().message + " (" + result.error().where + ")");
}

// Scenes and edits ---------------------------------------------------------------------------------------------------

/// A service on a folder of its own, which is removed at the end.
class Service {
 public:
  Service() : folder_(std::filesystem::temp_directory_path() / ("estimate-" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(folder_ / "root");
    std::filesystem::create_directories(folder_ / "edits");
    store_ = value(server::scenes::SceneStore::open({.folder = folder_ / "scenes", .scene_root = folder_ / "root"}));
    service_ =
        value(edits::EditService::open(*store_, {.folder = folder_ / "edits", .pictured_views = pictured_views}));
  }
  ~Service() {
    service_.reset();
    store_.reset();
    std::filesystem::remove_all(folder_);
  }
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;

  /// A scene, and the same one without its cameras: both ids.
  std::pair<std::string, std::string> add(const std::string& name, engine::scene::GaussianCloud cloud,
                                          const std::vector<engine::scene::Camera>& cameras) {
    const path there = folder_ / "root" / name;
    std::filesystem::create_directories(there / "sparse" / "0");
    succeed(server::cli::write_colmap_text(there / "sparse" / "0", cameras, cloud));
    io::SceneFile file{std::move(cloud), {}};
    file.layout = io::inria_layout(file.cloud.sh_degree);
    succeed(io::write_scene(there / "scene.ply", file, io::SceneFormat::ply));
    const std::string with = value(store_->add_path(name + "/scene.ply", name)).id;
    const std::string without = value(store_->add_path(name + "/scene.ply", name)).id;
    value(store_->put_dataset_path(with, name));
    return {with, without};
  }
  server::scenes::SceneStore& store() { return *store_; }
  edits::SpeedLog& speeds() { return speeds_; }
  edits::EditService& operator*() { return *service_; }
  edits::EditService* operator->() { return service_.get(); }

 private:
  path folder_;
  std::unique_ptr<server::scenes::SceneStore> store_;
  std::unique_ptr<edits::EditService> service_;
  edits::SpeedLog speeds_{engine::edit::measured_slowness};
};

struct Sample {
  std::string name;
  bool fitted = false;  ///< The constants of the plan were chosen to suit it; the others are a test of them.
  EditRequest request;
};

/// What a sample asks for beside its preset; 0: what the preset says.
struct Numbers {
  int intervals = 0, annealing_steps = 0, iterations = 0, views = 0, max_image_side = 0;
  bool corrected = true;
};

EditRequest with(EditRequest request, const std::string& scene, Preset preset, const Numbers& numbers = {}) {
  request.scene = scene, request.preset = preset, request.params = {};
  const auto set = [](std::optional<int>& field, int number) {
    if (number > 0) field = number;
  };
  set(request.params.intervals, numbers.intervals);
  set(request.params.annealing_steps, numbers.annealing_steps);
  set(request.params.iterations, numbers.iterations);
  set(request.params.views, numbers.views);
  set(request.params.max_image_side, numbers.max_image_side);
  if (!numbers.corrected) request.params.corrector = proto::Corrector::none;
  return request;
}

proto::Handle handle(proto::Point from, std::optional<proto::Point> to, double radius) {
  return {.source = from, .target = to, .radius = radius};
}

proto::selection::Operation sphere(proto::Point center, double radius) {
  return {proto::selection::Op::add, proto::selection::Sphere{center, radius}};
}

std::vector<Sample> demo_samples(Service& service) {
  auto demo = engine::procedural::make_demo_scene();
  const EditRequest ball = server::cli::to_request(demo.drags[0]), leaf = server::cli::to_request(demo.drags[1]);
  const auto [id, bare] = service.add("demo", std::move(demo.cloud), demo.cameras);
  EditRequest drawn = ball, large = ball;
  drawn.mode = proto::Mode::extend;
  for (proto::Handle& each : large.handles) each.radius = 3 * each.radius.value();
  auto big = engine::procedural::make_demo_scene({.gaussians = 500'000});
  const auto [big_id, big_bare] = service.add("large", std::move(big.cloud), big.cameras);
  return {
      {"preview, ball", true, with(ball, id, Preset::preview)},
      {"preview, leaf, no dataset", true, with(leaf, bare, Preset::preview)},
      {"draft, ball", true, with(ball, id, Preset::draft)},
      {"draft, ball, no dataset", true, with(ball, bare, Preset::draft)},
      {"standard, leaf, 100 iterations", true, with(leaf, id, Preset::standard, {.iterations = 100})},
      {"draft, ball drawn out, 100 iterations", true, with(drawn, id, Preset::draft, {.iterations = 100})},
      {"draft, large part, corrector none", true, with(large, id, Preset::draft, {.corrected = false})},
      {"standard, leaf, no dataset, 50 iterations, 30 views", false,
       with(leaf, bare, Preset::standard, {.iterations = 50, .views = 30})},
      {"paper, ball, 2 x 60 iterations", false,
       with(ball, id, Preset::paper, {.intervals = 2, .annealing_steps = 2, .iterations = 60})},
      {"preview, 150 views of 256 pixels, no dataset", false,
       with(ball, bare, Preset::preview, {.views = 150, .max_image_side = 256})},
      {"standard, large part, no dataset, 60 iterations, 16 views", false,
       with(large, bare, Preset::standard, {.iterations = 60, .views = 16})},
      {"draft, 500 k Gaussians", false, with(ball, big_id, Preset::draft)},
      {"preview, 500 k Gaussians, no dataset", false, with(leaf, big_bare, Preset::preview)},
  };
}

/// The drag of the left ear that comes with the capture.
std::vector<Sample> fox_samples(Service& service) {
  auto fox = bench::fox("0097.jpg");
  if (!fox) return {};
  const auto [id, bare] = service.add("fox", std::move(fox->cloud), fox->cameras);
  EditRequest ear;
  ear.handles = {handle({2.50, -1.46, 1.60}, proto::Point{2.56, -1.96, 1.62}, 0.3),
                 handle({2.36, -1.28, 1.68}, proto::Point{2.39, -1.53, 1.69}, 0.3),
                 handle({2.24, -0.88, 1.93}, std::nullopt, 0.3)};
  // Its head, turned by a tenth of a circle about an upright axis through its neck; and all of it, lifted.
  EditRequest head, whole;
  head.selection = {sphere({1.95, -0.35, 1.6}, 0.95)};
  head.handles = {
      {.source = {2.3, 0.1, 2.1}, .target = proto::Point{2.3, 0.1, 2.1}, .rotation = {{0.951, 0, 0.309, 0}}}};
  whole.selection = {sphere({2.1, 0.2, 2.2}, 1.9)};
  whole.handles = {{.source = {2.0, -0.3, 1.6}, .target = proto::Point{2.0, -0.7, 1.6}}};
  return {{"fox, draft, ear", false, with(ear, id, Preset::draft)},
          {"fox, draft, ear, no dataset", true, with(ear, bare, Preset::draft)},
          {"fox, draft, head turned", true, with(head, id, Preset::draft)},
          {"fox, draft, all of it", true, with(whole, id, Preset::draft)},
          {"fox, standard, ear, no dataset, 2 x 50 iterations", false,
           with(ear, bare, Preset::standard, {.intervals = 2, .iterations = 50})},
          {"fox, preview, head turned, no dataset", false, with(head, bare, Preset::preview)}};
}

// Runs ---------------------------------------------------------------------------------------------------------------

struct Run {
  double estimated = 0, seconds = 0;
  std::array<double, moments.size()> left{};  ///< Time left as told, over the true one; 0: nothing was told.
  double worst_left = 1;  ///< Between a tenth and nine tenths, the farthest off beyond `resolution`.
  std::map<std::string, std::pair<double, double>> stages;  ///< Planned, taken.
};

double off(double ratio) { return std::max(ratio, 1 / ratio); }

/// What was told of the time left, when.
struct Told {
  double at = 0;
  std::optional<double> left;
};

void judge(const std::vector<Told>& told, Run& run) {
  const auto ratio_at = [&](double time, double tolerance) {
    const Told* last = nullptr;
    for (const Told& each : told)
      if (each.at <= time) last = &each;
    if (last == nullptr || !last->left) return 0.0;
    const double left = run.seconds - time;
    return std::clamp(left, *last->left - tolerance, *last->left + tolerance) / left;
  };
  for (std::size_t k = 0; k < moments.size(); ++k) run.left[k] = ratio_at(moments[k] * run.seconds, 0);
  for (double part = 0.1; part <= 0.9; part += 0.01)
    if (const double ratio = ratio_at(part * run.seconds, resolution); ratio > 0 && off(ratio) > off(run.worst_left))
      run.worst_left = ratio;
}

void add_planned(const EditRequest& asked, Service& service, Run& run) {
  auto request = value(edits::to_engine(asked));
  const auto version = value(service.store().load(*asked.scene, "0"));
  const auto dataset = value(service.store().dataset(*asked.scene));
  const auto cameras = edits::cameras_of(dataset.get());
  if (asked.selection)
    value(edits::select_rows(*version.cloud.base, *asked.selection, {.views = cameras, .up = request.up}, request));
  const auto preview = value(engine::edit::preview(version.cloud, request));
  const auto work = edits::workload_of(version.cloud, request, preview, cameras, edits::uses_corrector(request.params),
                                       pictured_views, *asked.scene, service.speeds());
  for (const auto& planned : engine::edit::plan_of(work.edit))
    run.stages[std::string(engine::edit::name_of(planned.stage))].first += planned.seconds;
  std::printf("    dragged %zu, covered %.3f, frame %.2f ms + %.2f ns a pixel, views %zu of %zu pixels\n",
              work.edit.dragged, work.edit.covered, 1e3 * work.edit.frame.gaussians, 1e9 * work.edit.frame.pixel,
              work.edit.views, work.edit.view_pixels);
}

Run run_once(const EditRequest& request, Service& service, bool with_stages) {
  Run run;
  if (with_stages) add_planned(request, service, run);
  run.estimated = value(service->estimate(request)).seconds;
  const auto start = bench::Clock::now();
  const std::string id = value(service->submit(request, "")).status.id;
  std::vector<Told> told;
  for (;;) {
    const auto status = value(service->find(id));
    const double now = bench::seconds_since(start);
    told.push_back({now, status.eta_seconds});
    if (status.ended) {
      if (status.state != "succeeded") throw std::runtime_error(id + " " + status.state);
      run.seconds = now;
      for (const auto& timing : status.timings) run.stages[timing.stage].second += timing.seconds;
      break;
    }
    std::this_thread::sleep_for(look_every);
  }
  judge(told, run);
  return run;
}

Run middle_of(std::vector<Run> runs) {
  std::sort(runs.begin(), runs.end(),
            [](const Run& a, const Run& b) { return a.estimated / a.seconds < b.estimated / b.seconds; });
  Run middle = runs[runs.size() / 2];
  const auto middle_of_each = [&](auto member) {
    std::vector<double> values;
    for (const Run& run : runs) values.push_back(member(run));
    return bench::median(values);
  };
  for (std::size_t k = 0; k < moments.size(); ++k)
    middle.left[k] = middle_of_each([&](const Run& run) { return run.left[k]; });
  middle.worst_left = middle_of_each([](const Run& run) { return run.worst_left; });
  return middle;
}

// The page -----------------------------------------------------------------------------------------------------------

template <class... Values>
std::string line(const char* format, Values... values) {
  char text[400];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

/// A ratio, if anything was told; bold where it misses the aim.
std::string cell(double ratio) {
  if (!(ratio > 0)) return "none yet";
  return line(off(ratio) > aim ? "**%.2f**" : "%.2f", ratio);
}

std::string row(const Sample& sample, const Run& run) {
  const std::string worst = run.seconds < shortest ? "too short" : cell(run.worst_left);
  return line("| %s | %s | %.2f | %.2f | %s | %s | %s | %s | %s |\n", sample.name.c_str(),
              sample.fitted ? "fitted" : "tested", run.estimated, run.seconds,
              cell(run.estimated / run.seconds).c_str(), cell(run.left[0]).c_str(), cell(run.left[1]).c_str(),
              cell(run.left[2]).c_str(), worst.c_str());
}

std::string processor() {
  std::ifstream about("/proc/cpuinfo");
  for (std::string text; std::getline(about, text);)
    if (text.starts_with("model name")) return text.substr(text.find(':') + 2);
  return "an unnamed processor";
}

void print_stages(const Run& run) {
  for (const auto& [stage, seconds] : run.stages)
    if (std::max(seconds.first, seconds.second) > 0.01 * run.seconds)
      std::printf("    %-12s %8.3f planned %8.3f taken %6.2f\n", stage.c_str(), seconds.first, seconds.second,
                  seconds.first / seconds.second);
}

struct Options {
  std::string folder, only;
  int runs = 3;
  bool stages = false;
};

std::string page_of(const std::string& rows, int runs) {
  return "# Estimates against edits\n\n" + std::to_string(std::thread::hardware_concurrency()) + " cores of " +
         processor() + ", " + engine::render::simd_target() +
         ". Made by\n`build/release/bench/estimate docs`; medians of " + std::to_string(runs) +
         " runs.\n\n"
         "Each edit is estimated as `POST /v1/edits?validate_only=true` does it, a few frames of the scene included, "
         "and then\ncarried out by the service. The demo scene has 150 k Gaussians, the fox capture 62 k. On the edits "
         "marked `fitted`\nthe constants of the plan (`engine/edit/plan.cc`) were measured; the others are a test of "
         "them. How fast the time\nleft learns (`engine/edit/progress.cc`) was chosen on all of them. The aim is a "
         "factor "
         "of 1.5; what misses it is bold.\n\n"
         "The right half is about the time left that a running edit tells (`eta_seconds`), over the true one: when a "
         "tenth, a\nquarter and half of the time have passed (nothing is told before the edit has looked at the "
         "scene), "
         "and where it is\nfarthest off between a tenth and nine tenths, beyond what its rounding and its rate account "
         "for (0.17 s). Of edits\nshorter than 2 s that would be most of it.\n\n"
         "| edit | | estimated, s | took, s | ratio | left at 10 % | at 25 % | at 50 % | farthest off |\n"
         "| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n" +
         rows;
}

void compare(const Options& options) {
  Service service;
  std::vector<Sample> samples = demo_samples(service);
  for (Sample& sample : fox_samples(service)) samples.push_back(std::move(sample));
  std::string rows;
  for (const Sample& sample : samples) {
    if (!options.only.empty() && sample.name.find(options.only) == std::string::npos) continue;
    std::vector<Run> runs;
    for (int i = 0; i < options.runs; ++i) runs.push_back(run_once(sample.request, service, options.stages));
    const Run middle = middle_of(std::move(runs));
    rows += row(sample, middle);
    std::fputs(row(sample, middle).c_str(), stdout);
    if (options.stages) print_stages(middle);
    std::fflush(stdout);
  }
  if (!options.folder.empty()) std::ofstream(path(options.folder) / "estimates.md") << page_of(rows, options.runs);
}

}  // namespace

// NOLINTNEXTLINE(bugprone-exception-escape): it ends a benchmark, with its message
int main(int argc, char** argv) {
  CLI::App program("Compares estimates of edits with the edits.");
  Options options;
  program.add_option("FOLDER", options.folder, "Writes estimates.md there");
  program.add_option("--only", options.only, "Edits whose name has this in it");
  program.add_option("--runs", options.runs, "Of each edit")->check(CLI::Range(1, 100));
  program.add_flag("--stages", options.stages, "Prints each stage");
  CLI11_PARSE(program, argc, argv);
  try {
    compare(options);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
  return 0;
}
