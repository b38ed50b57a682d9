// splatdrag bench-edit: edits whose right result is known, carried out and judged.
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iterator>
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
#include "engine/io/image_file.h"
#include "engine/scene/overlay.h"
#include "proto/json_text.h"
#include "server/commands.h"
#include "server/compute.h"
#include "server/folders.h"

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
  std::vector<std::string> cases;
  std::string out;
  bool small = false;
  std::string corrector = "none";
  int intervals = 0, iterations = 0, annealing_steps = 1, views = 50, pictures = 1;
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

edit::Request request_of(const evaluate::Case& the_case, const BenchOptions& options) {
  edit::Request request = the_case.request;
  request.params.intervals = options.intervals;
  request.params.iterations = options.iterations;
  request.params.annealing_steps = options.annealing_steps;
  request.params.views = options.views;
  return request;
}

/// The corrector of that name; null: none.
std::unique_ptr<engine::correct::Corrector> make_corrector(const std::string& name) {
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

/// Names a result by all that it and its times depend on: the case, the request, the machine, and this very program.
std::string key_of(const evaluate::Case& the_case, const BenchOptions& options, const Machine& machine) {
  static const std::uint64_t program = [] {
    std::ifstream file("/proc/self/exe", std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    return engine::fnv1a(std::as_bytes(std::span(bytes)));
  }();
  const ordered_json all{
      options.corrector, the_case.name,    options.intervals, options.iterations, options.annealing_steps,
      options.views,     options.pictures, machine.threads,   machine.simd,       program};
  const std::string text = all.dump();
  std::ostringstream key;
  key << std::hex << std::setfill('0') << std::setw(16) << engine::fnv1a(std::as_bytes(std::span(text)));
  return the_case.name + "-" + key.str();
}

/// What an edit came to, and how long it took.
Result<ordered_json> judge(const evaluate::Case& the_case, const edit::Request& request,
                           const std::string& corrector_name, scene::GaussianCloud& edited) {
  forget_peak();
  const std::uint64_t before = status_bytes("VmRSS");
  const auto corrector = make_corrector(corrector_name);
  const auto outcome = edit::run(the_case.before, the_case.cameras, request, {}, nullptr, nullptr, corrector.get());
  if (!outcome) return propagate(outcome);
  const std::uint64_t peak = status_bytes("VmHWM");
  edited = scene::flatten(the_case.before, outcome->overlay);
  double seconds = 0;
  ordered_json stages = ordered_json::object();
  for (const edit::StageTime& time : outcome->report.times) {
    stages[time.stage] = time.seconds;
    seconds += time.seconds;
  }
  return ordered_json{{"case", the_case.name},
                      {"what", the_case.what},
                      {"gaussians", the_case.before.size()},
                      {"part", the_case.part_before.size()},
                      {"seeds", outcome->report.seeds},
                      {"intervals", outcome->report.resolved.intervals},
                      {"untouched", encode(evaluate::judge(the_case, the_case.before))},
                      {"result", encode(evaluate::judge(the_case, edited))},
                      {"seconds", seconds},
                      {"stages", std::move(stages)},
                      {"peak_memory_bytes", peak > before ? peak - before : 0},
                      {"warnings", outcome->report.warnings}};
}

Result<void> write_pictures(const evaluate::Case& the_case, const edit::Request& request,
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
    const path file = path(options.out) / (the_case.name + "_" + camera.name + ".png");
    if (auto saved = io::write_image(file, evaluate::comparison(the_case, deformed, edited, camera)); !saved)
      return saved;
  }
  return {};
}

std::string row(const ordered_json& found) {
  std::ostringstream out;
  out << "| " << found.at("case").get<std::string>() << std::fixed;
  for (const char* kind : {"edited", "vacated", "arrived", "outside"})
    out << " | " << std::setprecision(2) << found.at("result").at(kind).at("psnr_db").get<double>() << " | "
        << std::setprecision(4) << found.at("result").at(kind).at("ssim").get<double>();
  out << " | " << std::setprecision(4) << found.at("result").at("miss").get<double>() << " | " << std::setprecision(1)
      << found.at("seconds").get<double>() << " |\n";
  return out.str();
}

/// A result of an earlier run, if it is there and whole.
std::optional<ordered_json> kept_result(const path& file) {
  std::ifstream in(file);
  ordered_json kept = ordered_json::parse(in, nullptr, /*allow_exceptions=*/false);
  if (kept.is_discarded()) return std::nullopt;
  try {
    static_cast<void>(row(kept));
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;  // not what we wrote
  }
  return kept;
}

/// The result of a case: kept from an earlier run, or new and then kept.
Result<ordered_json> result_of(const evaluate::Case& the_case, const BenchOptions& options, const Machine& machine) {
  const path file = path(options.out) / "results" / (key_of(the_case, options, machine) + ".json");
  if (auto kept = kept_result(file)) return std::move(*kept);
  const edit::Request request = request_of(the_case, options);
  scene::GaussianCloud edited;
  auto found = judge(the_case, request, options.corrector, edited);
  if (!found) return found;
  if (auto written = write_pictures(the_case, request, edited, options); !written) return propagate(written);
  const std::string text = proto::pretty(*found) + "\n";
  if (auto kept = engine::write_file(file, std::as_bytes(std::span(text))); !kept) return propagate(kept);
  return found;
}

constexpr const char* table_head =
    "| case | edited, dB | SSIM | vacated, dB | SSIM | arrived, dB | SSIM | outside, dB | SSIM | miss | s |\n"
    "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n";

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

Result<void> run(const BenchOptions& options, Terminal& terminal) {
  const auto chosen = chosen_cases(options);
  if (!chosen) return propagate(chosen);
  if (auto made = make_folder(path(options.out) / "results"); !made) return made;
  return compute(options.compute, [&](const Machine& machine) -> Result<void> {
    std::string table = table_head;
    ordered_json all = ordered_json::array();
    terminal.out << table_head << std::flush;
    for (const std::string& name : *chosen) {
      const auto made = evaluate::make_case(name);
      if (!made) return propagate(made);
      auto found = result_of(*made, options, machine);
      if (!found) return propagate(found);
      table += row(*found);
      terminal.out << row(*found) << std::flush;
      all.push_back(std::move(*found));
    }
    const ordered_json report{{"splatdrag", SPLATDRAG_VERSION},
                              {"threads", machine.threads},
                              {"simd", machine.simd},
                              {"params",
                               {{"intervals", options.intervals},
                                {"iterations", options.iterations},
                                {"annealing_steps", options.annealing_steps},
                                {"views", options.views}}},
                              {"cases", std::move(all)}};
    const std::string json = proto::pretty(report) + "\n";
    if (auto saved = engine::write_file(path(options.out) / "bench.json", std::as_bytes(std::span(json))); !saved)
      return saved;
    return engine::write_file(path(options.out) / "bench.md", std::as_bytes(std::span(table)));
  });
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
  command->add_option("--corrector", options->corrector, "Which")
      ->check(CLI::IsMember({"none", "harmonic", "scene"}))
      ->type_name("NAME");
  command->add_option("--intervals", options->intervals, "Of each edit; 0: by the length of the drag")
      ->check(CLI::Range(0, 20))
      ->type_name("N");
  command->add_option("--iterations", options->iterations, "Of the optimisation per correction; 0: none")
      ->check(CLI::Range(0, 1'000'000))
      ->type_name("N");
  command->add_option("--annealing-steps", options->annealing_steps, "Corrections per interval")
      ->check(CLI::Range(1, 100))
      ->type_name("N");
  command->add_option("--views", options->views, "Most views an edit looks through")
      ->check(CLI::Range(1, edit::max_views))
      ->type_name("N");
  command
      ->add_option("--pictures", options->pictures,
                   "Held-out views to show per case: before, deformed, result, truth, four times the difference")
      ->check(CLI::Range(0, 1000))
      ->type_name("N");
  add_compute_options(*command, options->compute);
  command->callback([options, &action] { action = [options](Terminal& terminal) { return run(*options, terminal); }; });
}

}  // namespace server
