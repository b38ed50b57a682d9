// splatdrag bench-edit: edits whose right result is known, carried out and judged.
#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <ostream>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "engine/core/atomic_file.h"
#include "engine/core/names.h"
#include "engine/edit/request.h"
#include "engine/evaluate/cases.h"
#include "engine/evaluate/trial.h"
#include "engine/evaluate/trip_trial.h"
#include "engine/io/dataset.h"
#include "engine/io/scene_file.h"
#include "engine/optim/perceptual.h"
#include "engine/params/params.h"
#include "server/cli/bench_captures.h"
#include "server/cli/bench_edit.h"
#include "server/cli/bench_report.h"
#include "server/cli/commands.h"
#include "server/cli/compute.h"
#include "server/cli/folders.h"
#include "server/cli/request_file.h"
#include "server/edits/convert.h"
#include "server/edits/convert_selection.h"
#include "server/models/models.h"

namespace server::cli {
namespace {

namespace edit = engine::edit;
namespace evaluate = engine::evaluate;
namespace io = engine::io;
namespace scene = engine::scene;
using engine::propagate;
using nlohmann::ordered_json;
using std::filesystem::path;

bool repaints(const BenchOptions& options) { return std::ranges::count(options.correctors, "sd") > 0; }

/// What was made of a model, or why there is none, in words that name its file, which clients are not told.
template <class Made>
Result<Made> named(Result<Made> made, const models::Models& models, const std::string& name) {
  if (made) return made;
  for (const models::Finding& finding : models.findings())
    if (finding.name == name && !finding.usable) made.error().message = finding.message;
  made.error().where = "--model-dir";
  return made;
}

/// The network that judges the cases; null where no folder of models is named, or it is named for `sd` alone and has
/// nothing of LPIPS. What is there and damaged is an error.
Result<std::unique_ptr<engine::optim::PerceptualLoss>> lpips_of(const BenchOptions& options,
                                                                const models::Models& models) {
  const bool is_loss = options.given.perceptual == proto::Perceptual::lpips;
  const bool absent = std::ranges::any_of(
      models.findings(), [](const models::Finding& finding) { return finding.name == "lpips" && finding.absent; });
  if (options.model_dir.empty() || (absent && repaints(options) && !is_loss)) return nullptr;
  return named(models.lpips(), models, "lpips");
}

Result<evaluate::Trial> trial_of(const evaluate::Case& the_case, const std::string& corrector,
                                 const BenchOptions& options, const Machine& machine, const models::Models& models,
                                 engine::optim::PerceptualLoss* lpips) {
  edit::Request request = the_case.request;
  apply(options, request);
  std::unique_ptr<engine::correct::Repainter> repainter;
  if (corrector == "sd") {
    auto made = named(models.repainter(request.params, {}), models, "sd");
    if (!made) return propagate(made);
    repainter = std::move(*made);
  }
  const path file = cache_file(options, machine, the_case.name, corrector, {}, {}, request,
                               lpips != nullptr ? lpips->identity() : "", repainter ? repainter->state() : "");
  return cached_or_new<evaluate::Trial>(file, [&]() -> Result<evaluate::Trial> {
    auto done = evaluate::carry_out(the_case, request, corrector, lpips, repainter.get());
    if (!done) return propagate(done);
    const auto pictures = evaluate::show_pictures(the_case, request, corrector, done->edited,
                                                  std::size_t(options.pictures), picture_writer(options));
    if (!pictures) return propagate(pictures);
    return std::move(done->trial);
  });
}

Result<void> run_cases(const BenchOptions& options, const Machine& machine, Terminal& terminal) {
  auto chosen = evaluate::choose_cases(options.cases, options.small);
  if (!chosen) {
    if (chosen.error().where.empty()) chosen.error().where = "--case, --small";
    return propagate(chosen);
  }
  const models::Models models(options.model_dir, machine.threads);
  const auto lpips = lpips_of(options, models);
  if (!lpips) return propagate(lpips);
  std::string table = evaluate::trial_table_head();
  terminal.out << table << std::flush;
  ordered_json all = ordered_json::array();
  for (const std::string& name : *chosen) {
    const auto made = evaluate::make_case(name);
    if (!made) return propagate(made);
    for (const std::string& corrector : options.correctors) {
      const auto trial = trial_of(*made, corrector, options, machine, models, lpips->get());
      if (!trial) return propagate(trial);
      const std::string row = evaluate::trial_table_row(*trial);
      table += row;
      terminal.out << row << std::flush;
      all.push_back(encode(*trial));
    }
  }
  ordered_json report = settings(options, machine);
  report["cases"] = std::move(all);
  if (auto saved = write_json(path(options.out) / "bench.json", report); !saved) return saved;
  return engine::write_file(path(options.out) / "bench.md", std::as_bytes(std::span(table)));
}

/// A capture, and the drag to take there and back.
struct Capture {
  scene::GaussianCloud cloud;
  std::vector<scene::Camera> cameras;
  edit::Request request;
};

Result<Capture> load_capture(const BenchOptions& options) {
  const auto file = read_request(options.request, options.name);
  if (!file) return propagate(file);
  auto request = edits::to_engine(file->request);
  if (!request) return propagate(request);
  const auto& selection = file->request.selection;
  if (selection) request->selected.emplace();  // parameters depend on whether there is one
  apply(options, *request);
  auto input = io::read_scene(options.scene);
  if (!input) return propagate(input);
  const auto dataset = io::read_dataset(options.dataset, {.points = false});
  if (!dataset) return propagate(dataset);
  Capture capture{std::move(input->cloud), io::cameras_of(*dataset), std::move(*request)};
  if (selection) {
    const auto selected = edits::select_rows(capture.cloud, *selection,
                                             {.views = capture.cameras, .up = capture.request.up}, capture.request);
    if (!selected) return propagate(selected);
  }
  return capture;
}

/// There and back on a capture, with each corrector.
Result<void> run_trips(const BenchOptions& options, const Machine& machine, Terminal& terminal) {
  const auto capture = load_capture(options);
  if (!capture) return propagate(capture);
  ordered_json all = ordered_json::array();
  for (const std::string& corrector : options.correctors) {
    const path file = cache_file(options, machine, "trip", corrector, options.scene, options.dataset, capture->request);
    const auto trial = cached_or_new<evaluate::TripTrial>(file, [&] {
      auto done = evaluate::carry_out_trip(capture->cloud, capture->cameras, capture->request, corrector,
                                           std::size_t(options.pictures), picture_writer(options));
      if (done) done->request = options.name;
      return done;
    });
    if (!trial) return propagate(trial);
    terminal.out << evaluate::summary(*trial) << std::flush;
    all.push_back(encode(*trial));
  }
  ordered_json report = settings(options, machine);
  report["trips"] = std::move(all);
  return write_json(path(options.out) / "trips.json", report);
}

Result<void> run(const BenchOptions& options, Terminal& terminal) {
  if (repaints(options) && options.model_dir.empty())
    return engine::fail(engine::ErrorCode::invalid_argument, "sd needs --model-dir, and works on the cases alone",
                        "--corrector");
  edit::Request any;
  apply(options, any);
  const bool by_lpips = any.params.perceptual == proto::Perceptual::lpips && !options.model_dir.empty();
  if (!by_lpips)  // else lpips_of() says so
    if (auto all = edits::available({}, any.params, nullptr); !all) return all;
  if (auto made = make_folder(path(options.out) / "results"); !made) return made;
  return compute(options.compute, [&](const Machine& machine) -> Result<void> {
    if (options.captures.on) return run_captures(options, machine, terminal);
    return options.scene.empty() ? run_cases(options, machine, terminal) : run_trips(options, machine, terminal);
  });
}

/// The values of an enumeration by their names.
template <engine::Named Enum>
std::map<std::string, Enum> by_name() {
  std::map<std::string, Enum> values;
  for (const auto& name : engine::names<Enum>) values.emplace(name.text, name.value);
  return values;
}

/// Restricts an option to the values of a parameter.
void limit(CLI::Option& option, const engine::params::Range<int>& range) {
  option.check(CLI::Range(range.zero.empty() ? range.low : 0, range.high))->type_name("N");
}
void limit(CLI::Option& option, const engine::params::Range<double>& range) {
  option.check(CLI::Range(range.low, range.high))->type_name("X");
}
void limit(CLI::Option& option, const engine::params::Range<bool>&) { option.type_name("BOOLEAN"); }
void limit(CLI::Option& option, const engine::params::Range<std::uint64_t>&) { option.type_name("N"); }
void limit(CLI::Option& option, const engine::params::Range<std::vector<std::string>>&) { option.type_name("NAME"); }
template <engine::Named Enum>
void limit(CLI::Option& option, const engine::params::Range<Enum>&) {
  option.transform(CLI::CheckedTransformer(by_name<Enum>()))->type_name("NAME");
}

/// An option for a parameter, in place of what the preset says: "--annealing-steps".
template <class T>
void add_knob(CLI::App& command, const engine::params::Parameter<T>& parameter, proto::Params& given) {
  std::string flag = "--" + std::string(parameter.name);
  std::ranges::replace(flag, '_', '-');
  if (flag == "--max-image-side") flag += ",--image-side";  // as it was called at first
  std::string what(parameter.meaning);
  if (!parameter.unit.empty()) what += " In " + std::string(parameter.unit) + ".";
  if constexpr (std::is_same_v<T, int>)
    if (!parameter.range.zero.empty()) what += " 0: " + std::string(parameter.range.zero) + ".";
  limit(*command.add_option_function<T>(
            flag, [&given, &parameter](const T& value) { given.*parameter.given = value; }, what),
        parameter.range);
}

}  // namespace

void add_bench_edit_command(CLI::App& program, Action& action) {
  CLI::App* const command =
      program.add_subcommand("bench-edit", "Carries out edits whose right result is known, and judges them");
  const auto options = std::make_shared<BenchOptions>();
  std::string known;
  for (const std::string& name : evaluate::case_names()) known += (known.empty() ? "" : ", ") + name;
  command
      ->add_option(
          "--case", options->cases,
          "Which; may be repeated; all if none is named. There are " + known + "; with --captures " + captured_cases())
      ->default_str("")
      ->type_name("NAME");
  CLI::Option* const small = command->add_flag("--small", options->small, "Only those that are quick");
  command
      ->add_option("--out", options->out,
                   "Folder for bench.json, bench.md, pictures, and results by request: those that are there are not "
                   "worked out again")
      ->required()
      ->type_name("DIR");
  command
      ->add_option("--corrector", options->correctors,
                   "Which; may be repeated, harmonic is a baseline, sd needs --model-dir")
      ->check(CLI::IsMember({"none", "harmonic", "scene", "sd"}))
      ->default_str("scene")
      ->type_name("NAME");
  command->add_option("--preset", options->preset, "Whose parameters, where none are given here")
      ->transform(CLI::CheckedTransformer(by_name<proto::Preset>()))
      ->default_str("draft")
      ->type_name("NAME");
  engine::params::for_each_parameter([&](const auto& parameter) {
    if (parameter.on_wire && parameter.name != "corrector") add_knob(*command, parameter, options->given);
  });
  CLI::Option* const models =
      command
          ->add_option(
              "--model-dir", options->model_dir,
              "Folder of pre-trained networks (splatdrag models says which files): those of LPIPS for a column of the "
              "cases and --perceptual lpips, a diffusion model for --corrector sd")
          ->type_name("DIR");
  command->add_flag("--whole-picture", options->whole_picture, "Without the local mask: everything counts as edited");
  command
      ->add_option("--pictures", options->pictures,
                   "Held-out views to show per case: before, deformed, result, truth, four times the difference")
      ->check(CLI::Range(0, 1000))
      ->type_name("N");
  CLI::Option* const captures = add_capture_options(*command, options->captures);
  const auto capture = command->add_option("--scene", options->scene,
                                           "In place of the cases a real capture, without truth: the drag and the one "
                                           "that undoes it, judged at cameras between those of the capture");
  capture->type_name("FILE");
  CLI::Option* const dataset = command->add_option("--dataset", options->dataset, "Its cameras")->type_name("DIR");
  CLI::Option* const request = command->add_option("--request", options->request, "The drag")->type_name("FILE");
  command->add_option("--name", options->name, "Which request of a file of several")->type_name("NAME");
  capture->needs(dataset)->needs(request)->excludes(captures);
  small->excludes(captures);
  models->excludes(captures)->excludes(capture);
  add_compute_options(*command, options->compute);
  command->callback([options, &action] { action = [options](Terminal& terminal) { return run(*options, terminal); }; });
}

}  // namespace server::cli
