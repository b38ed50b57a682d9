#include "server/cli/bench_captures.h"

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <iomanip>
#include <memory>
#include <ostream>
#include <span>
#include <sstream>
#include <utility>
#include <vector>

#include "engine/captures/backdrop.h"
#include "engine/captures/capture_trial.h"
#include "engine/captures/captured_case.h"
#include "engine/captures/grasp.h"
#include "engine/captures/training.h"
#include "engine/core/atomic_file.h"
#include "engine/io/dataset.h"
#include "server/cli/bench_edit.h"
#include "server/cli/bench_report.h"
#include "server/cli/captures_page.h"
#include "server/cli/folders.h"
#include "server/cli/photos.h"
#include "server/edits/convert.h"

namespace server::cli {
namespace {

namespace captures = engine::captures;
namespace edit = engine::edit;
namespace evaluate = engine::evaluate;
using engine::propagate;
using nlohmann::ordered_json;
using std::filesystem::path;

std::string hexadecimal(std::uint64_t key) {
  std::ostringstream out;
  out << std::hex << std::setfill('0') << std::setw(16) << key;
  return out.str();
}

Result<path> cache_folder(const CaptureOptions& options) {
  auto folder = options.cache.empty() ? default_capture_cache() : Result<path>(path(options.cache));
  if (!folder) return folder;
  if (auto made = make_folder(*folder); !made) return propagate(made);
  return folder;
}

Result<captures::CaptureTrial> trial_of(const captures::ReadyCase& ready, const std::string& corrector,
                                        const BenchOptions& options, const Machine& machine) {
  edit::Request request = ready.judged.request;
  apply(options, request);
  edit::Request preview = ready.judged.request;
  proto::Params motion;  // what is given of it
  motion.interpolation = options.given.interpolation;
  motion.rotation = options.given.rotation;
  preview.params = edits::filled_in(motion, proto::Preset::preview, preview, preview.selected.has_value());
  const path file = cache_file(options, machine, ready.judged.name, corrector, hexadecimal(ready.key_before),
                               hexadecimal(ready.key_after), request);
  auto trial = cached_or_new<captures::CaptureTrial>(file, [&]() -> Result<captures::CaptureTrial> {
    auto done = captures::carry_out(ready, request, preview, corrector);
    if (!done) return propagate(done);
    const auto pictures = evaluate::show_pictures(ready.judged, request, ready.grasp.by + "_" + corrector, done->edited,
                                                  std::size_t(options.pictures), picture_writer(options));
    if (!pictures) return propagate(pictures);
    return std::move(done->trial);
  });
  if (trial) trial->by = ready.grasp.by;  // another way may have asked for the same
  return trial;
}

/// The photos of a dataset, and a scene that is trained from all of them.
Result<std::shared_ptr<const captures::Backdrop>> backdrop_of(const CaptureOptions& options, const path& cache) {
  const auto dataset = engine::io::read_dataset(options.photos);
  if (!dataset) return propagate(dataset);
  auto photos = load_photos(*dataset, options.photo_side);
  if (!photos) return propagate(photos);
  auto points = sparse_points_of(*dataset);
  if (!points) return propagate(points);
  captures::Capture capture{std::move(*photos), std::move(*points)};
  auto trained = captures::trained(capture, captures::training_options(options.fit_iterations), cache);
  if (!trained) return propagate(trained);
  return std::make_shared<const captures::Backdrop>(
      captures::Backdrop{std::filesystem::weakly_canonical(dataset->root).filename().string(),
                         std::move(capture.photos), std::move(capture.points), std::move(trained->cloud)});
}

/// What makes a case of a name.
using Maker = std::function<Result<captures::CapturedCase>(const std::string& name)>;
Result<Maker> maker_of(const CaptureOptions& options, const path& cache) {
  if (options.photos.empty())
    return Maker([&](const std::string& name) { return captures::make_captured_case(name, options.take); });
  const auto backdrop = backdrop_of(options, cache);
  if (!backdrop) return propagate(backdrop);
  captures::Stand stand = options.stand;
  stand.at = {options.at[0], options.at[1]}, stand.to = {options.to[0], options.to[1]};
  return Maker([stand, backdrop = *backdrop](const std::string& name) {
    auto made = captures::make_drawn_case(name, backdrop, stand);
    if (!made && !made.error().where.empty()) made.error().where = "--" + made.error().where;
    return made;
  });
}

/// Every case with every corrector. Rows are shown as they come.
Result<std::vector<captures::CaptureTrial>> trials_of(const std::vector<std::string>& names, const path& cache,
                                                      const BenchOptions& options, const Machine& machine,
                                                      Terminal& terminal) {
  terminal.out << captures::capture_table_head() << std::flush;
  std::vector<captures::CaptureTrial> trials;
  const auto make = maker_of(options.captures, cache);
  if (!make) return propagate(make);
  for (const std::string& name : names) {
    const auto made = (*make)(name);
    if (!made) return propagate(made);
    const auto trained = captures::train(*made, captures::training_options(options.captures.fit_iterations), cache);
    if (!trained) return propagate(trained);
    for (const captures::NamedGrasp& way : captures::known_grasps()) {
      if (std::ranges::find(options.captures.by, way.name) == options.captures.by.end()) continue;
      const auto ready = captures::make_ready(*made, *trained, way.grasp);
      if (!ready) return propagate(ready);
      for (const std::string& corrector : options.correctors) {
        auto trial = trial_of(*ready, corrector, options, machine);
        if (!trial) return propagate(trial);
        terminal.out << captures::capture_table_row(*trial) << std::flush;
        trials.push_back(std::move(*trial));
      }
    }
  }
  return trials;
}

Result<void> write_text(const path& file, const std::string& text) {
  return engine::write_file(file, std::as_bytes(std::span(text)));
}

/// Those of cases that are drawn into photos.
///   returns  the one that switches them on
CLI::Option* add_drawn_options(CLI::App& command, CaptureOptions& options) {
  CLI::Option* const photos =
      command.add_option("--photos", options.photos,
                         "Dataset into whose photos the things of the cases are drawn, standing on what they show at "
                         "--at, and slid to --to: the truth is the photos that are held out, with the thing drawn in "
                         "there. What it hides are real places");
  photos->type_name("DIR");
  CLI::Option* const view = command.add_option("--view", options.stand.view, "Photo that --at and --to speak of");
  view->needs(photos)->type_name("NAME");
  const auto place = [&](const char* flag, std::vector<double>& at, const char* what) {
    CLI::Option* const option = command.add_option(flag, at, what);
    option->needs(photos)->expected(2)->delimiter(',')->check(CLI::Range(0.0, 1.0))->type_name("X,Y");
    return option;
  };
  CLI::Option* const at =
      place("--at", options.at, "Where the thing stands, in parts of the picture's width and height");
  CLI::Option* const to = place("--to", options.to, "Where it is to be");
  command
      .add_option("--size", options.stand.size, "Of the thing's longest side there, in parts of the picture's height")
      ->needs(photos)
      ->check(CLI::Range(0.01, 1.0))
      ->type_name("X");
  command.add_option("--photo-side", options.photo_side, "Longer side of the photos as they are used, pixels")
      ->needs(photos)
      ->check(CLI::Range(64, 4096))
      ->type_name("N");
  photos->needs(view)->needs(at)->needs(to);
  return photos;
}

}  // namespace

CLI::Option* add_capture_options(CLI::App& command, CaptureOptions& options) {
  CLI::Option* const on =
      command.add_flag("--captures", options.on,
                       "Scenes that are trained from photographs: made-up ones are photographed before and after the "
                       "edit, with noise, in changing exposures, from a part of an orbit");
  command
      .add_option("--cache", options.cache,
                  "Folder for the trained scenes of --captures, by what they were trained from; by default "
                  "splatdrag/captures below $XDG_CACHE_HOME or ~/.cache")
      ->needs(on)
      ->type_name("DIR");
  CLI::Option* const page =
      command.add_option("--page", options.page, "Also write what --captures finds as a page for people");
  page->needs(on)->type_name("FILE");
  std::vector<std::string> ways;
  for (const captures::NamedGrasp& way : captures::known_grasps()) ways.push_back(way.name);
  command
      .add_option(
          "--by", options.by,
          "How a request of --captures says what moves: balls around its handles (within a box; or bare, of the "
          "best size), a selection that grows from one click, with more or less asked for, from at most "
          "six, or from as many of a person who looks and corrects, or masks of three photos, true or five pixels too "
          "wide (default: all in turn)")
      ->needs(on)
      ->check(CLI::IsMember(ways))
      ->type_name("WAY");
  command.add_option("--fit-iterations", options.fit_iterations, "Photos that each fit of --captures learns from")
      ->needs(on)
      ->check(CLI::Range(1, 1'000'000))
      ->type_name("N");
  CLI::Option* const take = command.add_option(
      "--take", options.take,
      "Which photos and which errors of the hand: those of the first take are what constants are chosen on; "
      "other takes have others, of the same scenes and the same wishes. Give each its own --out");
  take->needs(on)->check(CLI::Range(1, 1'000'000))->type_name("N");
  add_drawn_options(command, options)->needs(on)->excludes(take)->excludes(page);
  return on;
}

std::string captured_cases() {
  std::string known;
  for (const std::string& name : captures::captured_case_names()) known += (known.empty() ? "" : ", ") + name;
  return known;
}

Result<path> default_capture_cache() {
  const auto folder = [](const char* variable) {
    const char* const value = std::getenv(variable);
    return value == nullptr ? path() : path(value);
  };
  const path below = "splatdrag/captures";
  // The XDG Base Directory Specification: a path that is not absolute is to be ignored.
  if (const path cache = folder("XDG_CACHE_HOME"); cache.is_absolute()) return cache / below;
  if (const path home = folder("HOME"); home.is_absolute()) return home / ".cache" / below;
  return engine::fail(engine::ErrorCode::invalid_argument,
                      "neither XDG_CACHE_HOME nor HOME says where to keep trained scenes: name a folder", "--cache");
}

Result<void> run_captures(const BenchOptions& options, const Machine& machine, Terminal& terminal) {
  if (!options.captures.photos.empty() && options.cases.empty())
    return engine::fail(engine::ErrorCode::invalid_argument, "say whose things are to be drawn into the photos",
                        "--case");
  const auto names = captures::choose_captured_cases(options.cases);
  if (!names) return propagate(names);
  const auto cache = cache_folder(options.captures);
  if (!cache) return propagate(cache);
  const path page = options.captures.page;
  if (!page.empty())  // better now than after minutes of work
    if (const auto writable = engine::AtomicFile::create(page); !writable) return propagate(writable);

  const auto trials = trials_of(*names, *cache, options, machine, terminal);
  if (!trials) return propagate(trials);
  std::string table = captures::capture_table_head();
  ordered_json all = ordered_json::array();
  for (const captures::CaptureTrial& trial : *trials) {
    table += captures::capture_table_row(trial);
    all.push_back(encode(trial));
  }
  ordered_json report = settings(options, machine);
  report["fit_iterations"] = options.captures.fit_iterations;
  report["take"] = options.captures.take;
  if (!options.captures.photos.empty())
    report["photos"] = {{"dataset", options.captures.photos},  {"side", options.captures.photo_side},
                        {"view", options.captures.stand.view}, {"at", options.captures.at},
                        {"to", options.captures.to},           {"size", options.captures.stand.size}};
  report["captures"] = std::move(all);
  if (auto saved = write_json(path(options.out) / "captures.json", report); !saved) return saved;
  if (auto saved = write_text(path(options.out) / "captures.md", table); !saved) return saved;
  if (page.empty()) return {};
  return write_text(page, captures_page(*trials, options, machine));
}

}  // namespace server::cli
