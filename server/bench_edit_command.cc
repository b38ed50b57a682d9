// splatdrag bench-edit: edits whose right result is known, carried out and judged.
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iomanip>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "engine/core/atomic_file.h"
#include "engine/core/checksum.h"
#include "engine/correct/scene_corrector.h"
#include "engine/edit/edit.h"
#include "engine/evaluate/cases.h"
#include "engine/evaluate/harmonic_corrector.h"
#include "engine/evaluate/measure.h"
#include "engine/evaluate/round_trip.h"
#include "engine/io/dataset.h"
#include "engine/io/image_file.h"
#include "engine/io/scene_file.h"
#include "engine/scene/overlay.h"
#include "proto/json_text.h"
#include "proto/params_fields.h"
#include "server/commands.h"
#include "server/compute.h"
#include "server/edits/convert.h"
#include "server/folders.h"
#include "server/request_file.h"

namespace server {
namespace {

namespace edit = engine::edit;
namespace evaluate = engine::evaluate;
namespace io = engine::io;
namespace scene = engine::scene;
using engine::propagate;
using nlohmann::ordered_json;
using std::filesystem::path;

struct BenchOptions {
  std::vector<std::string> cases, correctors{"scene"};
  std::string out;
  proto::Preset preset = proto::Preset::draft;
  proto::Params given;                        // over the preset
  std::string scene, dataset, request, name;  // a real capture, there and back
  bool small = false, whole_picture = false;
  int pictures = 1;
  ComputeOptions compute;
};

ordered_json encode(const evaluate::Likeness& likeness) {
  return {{"psnr_db", likeness.psnr_db}, {"ssim", likeness.ssim}, {"pixels", likeness.pixels}};
}

ordered_json encode(const evaluate::Quality& quality) {
  return {{"edited", encode(quality.edited)},
          {"vacated", encode(quality.vacated)},
          {"arrived", encode(quality.arrived)},
          {"outside", encode(quality.outside)},
          {"miss", quality.miss}};
}

/// What is given on the command line, over the preset.
void apply(const BenchOptions& options, edit::Request& request) {
  request.params = edits::filled_in(options.given, options.preset, request);
  request.params.local_mask = !options.whole_picture;
}

/// Those parameters that a request could give; which corrector is not one of them here.
ordered_json encode(const edit::Params& params) {
  ordered_json out = proto::encode(engine::params::as_given(params));
  out.erase("corrector");
  return out;
}

/// The corrector of that name; null: none.
std::unique_ptr<engine::correct::Corrector> corrector_named(const std::string& name) {
  if (name == "scene") return std::make_unique<engine::correct::SceneCorrector>();
  if (name == "harmonic") return std::make_unique<evaluate::HarmonicCorrector>();
  return nullptr;
}

/// A field of /proc/self/status in bytes, 0 where there is no such file.
std::uint64_t status_bytes(const std::string& field) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(field + ":")) return 1024 * std::stoull(line.substr(field.size() + 1));
  return 0;
}

/// Starts the peak of memory anew, where the system lets us.
void forget_peak() { std::ofstream("/proc/self/clear_refs") << "5"; }

/// Names a result by all that it and its times depend on: the subject, the request, the machine, and this very program.
std::string key_of(const std::string& subject, const std::string& corrector, const edit::Request& request,
                   const BenchOptions& options, const Machine& machine) {
  static const std::uint64_t program = [] {
    std::ifstream file("/proc/self/exe", std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    return engine::fnv1a(std::as_bytes(std::span(bytes)));
  }();
  ordered_json all{subject,          corrector,     encode(request.params), request.params.local_mask,
                   options.pictures, options.scene, options.dataset,        machine.threads,
                   machine.simd,     program};
  all.push_back(int(request.mode));
  for (const edit::Handle& handle : request.handles) {
    all.push_back({handle.radius, handle.group, handle.target.has_value()});
    for (int axis = 0; axis < 3; ++axis)
      all.push_back({handle.source[axis], handle.target.value_or(handle.source)[axis]});
  }
  for (int axis = 0; request.region && axis < 3; ++axis)
    all.push_back({request.region->center[axis], request.region->size[axis]});
  const std::string text = all.dump();
  std::ostringstream key;
  key << std::hex << std::setfill('0') << std::setw(16) << engine::fnv1a(std::as_bytes(std::span(text)));
  return subject + "-" + corrector + "-" + key.str();
}

/// What an edit came to, and how long it took.
Result<ordered_json> judge(const evaluate::Case& the_case, const edit::Request& request,
                           const std::string& corrector_name, scene::GaussianCloud& edited) {
  forget_peak();
  const std::uint64_t before = status_bytes("VmRSS");
  const auto corrector = corrector_named(corrector_name);
  evaluate::Agreement agreement;  // of the last correction
  std::uint64_t peak = 0;
  edit::Observer observer;
  observer.moment = [&](const edit::Moment& moment) -> Result<void> {
    peak = std::max(peak, status_bytes("VmHWM"));  // what the judge takes does not count
    if (!moment.pictures.empty() && moment.interval == moment.intervals)
      agreement = evaluate::agreement(the_case, moment.views, moment.pictures);
    forget_peak();
    return {};
  };
  const auto outcome =
      edit::run(the_case.before, the_case.cameras, request, observer, nullptr, nullptr, corrector.get());
  if (!outcome) return propagate(outcome);
  peak = std::max(peak, status_bytes("VmHWM"));
  edited = scene::flatten(the_case.before, outcome->overlay);
  double seconds = 0;
  ordered_json stages = ordered_json::object();
  for (const edit::StageTime& time : outcome->report.times) {
    if (time.stage == "renders") continue;  // for the judge alone
    stages[time.stage] = time.seconds;
    seconds += time.seconds;
  }
  return ordered_json{{"case", the_case.name},
                      {"what", the_case.what},
                      {"corrector", corrector_name},
                      {"textured", the_case.textured},
                      {"gaussians", the_case.before.size()},
                      {"part", the_case.part_before.size()},
                      {"seeds", outcome->report.seeds},
                      {"intervals", outcome->report.resolved.intervals},
                      {"untouched", encode(evaluate::judge(the_case, the_case.before))},
                      {"result", encode(evaluate::judge(the_case, edited))},
                      {"corrected_views_agree", {{"psnr_db", agreement.psnr_db}, {"pixels", agreement.pixels}}},
                      {"seconds", seconds},
                      {"stages", std::move(stages)},
                      {"peak_memory_bytes", peak > before ? peak - before : 0},
                      {"warnings", outcome->report.warnings}};
}

Result<void> write_pictures(const evaluate::Case& the_case, const edit::Request& request, const std::string& corrector,
                            const scene::GaussianCloud& edited, const BenchOptions& options) {
  if (options.pictures == 0) return {};
  scene::GaussianCloud deformed = edited;
  if (request.params.iterations > 0) {
    edit::Request deform_only = request;
    deform_only.params.iterations = 0;
    const auto dry = edit::run(the_case.before, the_case.cameras, deform_only);
    if (!dry) return propagate(dry);
    deformed = scene::flatten(the_case.before, dry->overlay);
  }
  for (std::size_t v = 0; v < std::min(std::size_t(options.pictures), the_case.held_out.size()); ++v) {
    const scene::Camera& camera = the_case.held_out[v];
    const path file = path(options.out) / (the_case.name + "_" + corrector + "_" + camera.name + ".png");
    if (auto saved = io::write_image(file, evaluate::comparison(the_case, deformed, edited, camera)); !saved)
      return saved;
  }
  return {};
}

std::string row(const ordered_json& found) {
  std::ostringstream out;
  out << "| " << found.at("case").get<std::string>() << " | " << found.at("corrector").get<std::string>() << std::fixed;
  for (const char* kind : {"edited", "vacated", "arrived", "outside"})
    out << " | " << std::setprecision(2) << found.at("result").at(kind).at("psnr_db").get<double>() << " | "
        << std::setprecision(4) << found.at("result").at(kind).at("ssim").get<double>();
  out << " | " << std::setprecision(4) << found.at("result").at("miss").get<double>() << " | " << std::setprecision(2);
  const ordered_json& agreement = found.at("corrected_views_agree");
  if (agreement.at("pixels").get<std::size_t>() > 0)
    out << agreement.at("psnr_db").get<double>();
  else
    out << "-";
  out << " | " << std::setprecision(1) << found.at("seconds").get<double>() << " |\n";
  return out.str();
}

std::string trip_line(const ordered_json& found) {
  const auto decibels = [&](const char* kind) { return found.at(kind).at("psnr_db").get<double>(); };
  std::ostringstream out;
  out << std::fixed << std::setprecision(2) << "there and back, " << found.at("corrector").get<std::string>() << ": "
      << 100 * found.at("arrived").get<double>() << " % of the drag arrived; inside " << decibels("inside")
      << " dB, outside " << decibels("outside") << " dB; " << std::setprecision(1) << found.at("seconds").get<double>()
      << " s there; zero drag, inside " << decibels("zero_drag") << " dB\n";
  return out.str();
}

/// How a result reads; throws what nlohmann::json does where a field is missing.
using Line = std::string (*)(const ordered_json& found);

/// A result of an earlier run, if it is there and whole.
std::optional<ordered_json> kept_result(const path& file, Line line) {
  std::ifstream in(file);
  ordered_json kept = ordered_json::parse(in, nullptr, /*allow_exceptions=*/false);
  if (kept.is_discarded()) return std::nullopt;
  try {
    static_cast<void>(line(kept));
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;  // not what we wrote
  }
  return kept;
}

/// A result: kept from an earlier run, or new and then kept.
Result<ordered_json> kept_or(const path& file, Line line, const std::function<Result<ordered_json>()>& find) {
  if (auto kept = kept_result(file, line)) return std::move(*kept);
  auto found = find();
  if (!found) return found;
  const std::string text = proto::pretty(*found) + "\n";
  if (auto kept = engine::write_file(file, std::as_bytes(std::span(text))); !kept) return propagate(kept);
  return found;
}

Result<ordered_json> result_of(const evaluate::Case& the_case, const std::string& corrector,
                               const BenchOptions& options, const Machine& machine) {
  edit::Request request = the_case.request;
  apply(options, request);
  const std::string key = key_of(the_case.name, corrector, request, options, machine);
  return kept_or(path(options.out) / "results" / (key + ".json"), row, [&]() -> Result<ordered_json> {
    scene::GaussianCloud edited;
    auto found = judge(the_case, request, corrector, edited);
    if (!found) return found;
    if (auto written = write_pictures(the_case, request, corrector, edited, options); !written)
      return propagate(written);
    return found;
  });
}

constexpr const char* table_head =
    "| case | corrector | edited, dB | SSIM | vacated, dB | SSIM | arrived, dB | SSIM | outside, dB | SSIM | miss "
    "| views agree, dB | s |\n"
    "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n";

/// The cases asked for, by name.
Result<std::vector<std::string>> chosen_cases(const BenchOptions& options) {
  const std::vector<std::string>& all = evaluate::case_names();
  for (const std::string& name : options.cases)
    if (std::find(all.begin(), all.end(), name) == all.end()) return propagate(evaluate::make_case(name));
  std::vector<std::string> chosen;
  for (const std::string& name : options.cases.empty() ? all : options.cases)
    if (!options.small || evaluate::is_small(name)) chosen.push_back(name);
  if (chosen.empty())
    return engine::fail(engine::ErrorCode::invalid_argument, "none of these cases is small", "--case, --small");
  return chosen;
}

/// What stands at the head of every report.
ordered_json settings(const BenchOptions& options, const Machine& machine) {
  edit::Request any;
  apply(options, any);
  ordered_json params{{"preset", proto::name_of(options.preset)}};
  params.update(encode(any.params));
  if (!options.given.intervals) params["intervals"] = nullptr;  // they depend on the drag
  params["local_mask"] = any.params.local_mask;
  return {{"splatdrag", SPLATDRAG_VERSION},
          {"threads", machine.threads},
          {"simd", machine.simd},
          {"params", std::move(params)}};
}

Result<void> write_text(const path& file, const std::string& text) {
  return engine::write_file(file, std::as_bytes(std::span(text)));
}

Result<void> run_cases(const BenchOptions& options, const Machine& machine, Terminal& terminal) {
  const auto chosen = chosen_cases(options);
  if (!chosen) return propagate(chosen);
  std::string table = table_head;
  ordered_json all = ordered_json::array();
  terminal.out << table_head << std::flush;
  for (const std::string& name : *chosen) {
    const auto made = evaluate::make_case(name);
    if (!made) return propagate(made);
    for (const std::string& corrector : options.correctors) {
      auto found = result_of(*made, corrector, options, machine);
      if (!found) return propagate(found);
      table += row(*found);
      terminal.out << row(*found) << std::flush;
      all.push_back(std::move(*found));
    }
  }
  ordered_json report = settings(options, machine);
  report["cases"] = std::move(all);
  if (auto saved = write_text(path(options.out) / "bench.json", proto::pretty(report) + "\n"); !saved) return saved;
  return write_text(path(options.out) / "bench.md", table);
}

/// Input, half-way, and what came back, at one camera.
scene::Image trip_picture(const scene::GaussianCloud& input, const evaluate::RoundTrip& trip,
                          const scene::Camera& camera) {
  scene::Image out(3 * camera.width, camera.height, 3);
  int x = 0;
  for (const scene::GaussianCloud* cloud : {&input, &trip.halfway, &trip.back}) {
    scene::paste(evaluate::picture(*cloud, camera), {x, 0, x + camera.width, camera.height}, out);
    x += camera.width;
  }
  return out;
}

/// There and back on a capture, with each corrector.
Result<void> run_trips(const BenchOptions& options, const Machine& machine, Terminal& terminal) {
  const auto asked = read_request(options.request, options.name);
  if (!asked) return propagate(asked);
  auto request = edits::to_engine(asked->request);
  if (!request) return propagate(request);
  apply(options, *request);
  const auto input = io::read_scene(options.scene);
  if (!input) return propagate(input);
  const auto dataset = io::read_dataset(options.dataset, {.points = false});
  if (!dataset) return propagate(dataset);
  std::vector<scene::Camera> cameras;
  for (const io::View& view : dataset->views) cameras.push_back(view.camera);

  ordered_json all = ordered_json::array();
  for (const std::string& corrector : options.correctors) {
    const std::string key = key_of("trip", corrector, *request, options, machine);
    auto found = kept_or(path(options.out) / "results" / (key + ".json"), trip_line, [&]() -> Result<ordered_json> {
      const auto own = corrector_named(corrector);
      const auto trip = evaluate::there_and_back(input->cloud, cameras, *request, own.get());
      if (!trip) return propagate(trip);
      const auto still = evaluate::zero_drag(input->cloud, cameras, *request, own.get());
      if (!still) return propagate(still);
      for (std::size_t v = 0; v < std::min(std::size_t(options.pictures), trip->cameras.size()); ++v) {
        const path file = path(options.out) / ("trip_" + corrector + "_" + std::to_string(v) + ".png");
        if (auto saved = io::write_image(file, trip_picture(input->cloud, *trip, trip->cameras[v])); !saved)
          return propagate(saved);
      }
      return ordered_json{{"request", options.name},          {"corrector", corrector},
                          {"arrived", trip->arrived},         {"inside", encode(trip->inside)},
                          {"outside", encode(trip->outside)}, {"zero_drag", encode(*still)},
                          {"cameras", trip->cameras.size()},  {"seconds", trip->seconds}};
    });
    if (!found) return propagate(found);
    terminal.out << trip_line(*found) << std::flush;
    all.push_back(std::move(*found));
  }
  ordered_json report = settings(options, machine);
  report["trips"] = std::move(all);
  return write_text(path(options.out) / "trips.json", proto::pretty(report) + "\n");
}

Result<void> run(const BenchOptions& options, Terminal& terminal) {
  edit::Request any;
  apply(options, any);
  if (auto all = edits::available(any.params); !all) return all;
  if (auto made = make_folder(path(options.out) / "results"); !made) return made;
  return compute(options.compute, [&](const Machine& machine) -> Result<void> {
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
  command->add_option("--case", options->cases, "Which; may be repeated; all if none is named. There are " + known)
      ->default_str("")
      ->type_name("NAME");
  command->add_flag("--small", options->small, "Only those that are quick");
  command
      ->add_option("--out", options->out,
                   "Folder for bench.json, bench.md, pictures, and results by request: those that are there are not "
                   "worked out again")
      ->required()
      ->type_name("DIR");
  command->add_option("--corrector", options->correctors, "Which; may be repeated, harmonic is a baseline")
      ->check(CLI::IsMember({"none", "harmonic", "scene"}))
      ->default_str("scene")
      ->type_name("NAME");
  command->add_option("--preset", options->preset, "Whose parameters, where none are given here")
      ->transform(CLI::CheckedTransformer(by_name<proto::Preset>()))
      ->default_str("draft")
      ->type_name("NAME");
  engine::params::for_each_parameter([&](const auto& parameter) {
    if (parameter.on_wire && parameter.name != "corrector") add_knob(*command, parameter, options->given);
  });
  command->add_flag("--whole-picture", options->whole_picture, "Without the local mask: everything counts as edited");
  command
      ->add_option("--pictures", options->pictures,
                   "Held-out views to show per case: before, deformed, result, truth, four times the difference")
      ->check(CLI::Range(0, 1000))
      ->type_name("N");
  const auto capture = command->add_option("--scene", options->scene,
                                           "In place of the cases a real capture, without truth: the drag and the one "
                                           "that undoes it, judged at cameras between those of the capture");
  capture->type_name("FILE");
  CLI::Option* const dataset = command->add_option("--dataset", options->dataset, "Its cameras")->type_name("DIR");
  CLI::Option* const request = command->add_option("--request", options->request, "The drag")->type_name("FILE");
  command->add_option("--name", options->name, "Which request of a file of several")->type_name("NAME");
  capture->needs(dataset)->needs(request);
  add_compute_options(*command, options->compute);
  command->callback([options, &action] { action = [options](Terminal& terminal) { return run(*options, terminal); }; });
}

}  // namespace server
