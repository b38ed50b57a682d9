// splatdrag bench-edit: edits whose right result is known, carried out and judged.
#include <algorithm>
#include <filesystem>
#include <iomanip>
#include <memory>
#include <nlohmann/json.hpp>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

#include "engine/core/atomic_file.h"
#include "engine/edit/edit.h"
#include "engine/evaluate/cases.h"
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
  int intervals = 0, iterations = 0, annealing_steps = 1, views = 50, pictures = 1;
  ComputeOptions compute;
};

/// What a case came to.
struct Judged {
  evaluate::Quality untouched, result;
  double seconds = 0;
  ordered_json json;
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

Result<Judged> judge(const evaluate::Case& the_case, const BenchOptions& options) {
  const edit::Request request = request_of(the_case, options);
  const auto outcome = edit::run(the_case.before, the_case.cameras, request);
  if (!outcome) return propagate(outcome);
  const scene::GaussianCloud result = scene::flatten(the_case.before, outcome->overlay);

  Judged judged;
  judged.untouched = evaluate::judge(the_case, the_case.before);
  judged.result = evaluate::judge(the_case, result);
  ordered_json stages = ordered_json::object();
  for (const edit::StageTime& time : outcome->report.times) {
    stages[time.stage] = time.seconds;
    judged.seconds += time.seconds;
  }
  judged.json = {{"case", the_case.name},
                 {"what", the_case.what},
                 {"gaussians", the_case.before.size()},
                 {"part", the_case.part_before.size()},
                 {"intervals", outcome->report.resolved.intervals},
                 {"untouched", encode(judged.untouched)},
                 {"result", encode(judged.result)},
                 {"seconds", judged.seconds},
                 {"stages", std::move(stages)},
                 {"warnings", outcome->report.warnings}};

  if (options.pictures == 0) return judged;
  scene::GaussianCloud deformed = result;
  if (request.params.iterations > 0) {
    edit::Request deform_only = request;
    deform_only.params.iterations = 0;
    const auto dry = edit::run(the_case.before, the_case.cameras, deform_only);
    if (!dry) return propagate(dry);
    deformed = scene::flatten(the_case.before, dry->overlay);
  }
  for (std::size_t v = 0; v < std::min<std::size_t>(std::size_t(options.pictures), the_case.held_out.size()); ++v) {
    const scene::Camera& camera = the_case.held_out[v];
    const path file = path(options.out) / (the_case.name + "_" + camera.name + ".png");
    if (auto saved = io::write_image(file, evaluate::comparison(the_case, deformed, result, camera)); !saved)
      return propagate(saved);
  }
  return judged;
}

std::string row(const std::string& name, const Judged& judged) {
  std::ostringstream out;
  const auto cell = [&](const evaluate::Likeness& likeness) {
    out << " | " << std::fixed << std::setprecision(2) << likeness.psnr_db << " | " << std::setprecision(4)
        << likeness.ssim;
  };
  out << "| " << name;
  cell(judged.result.edited), cell(judged.result.vacated), cell(judged.result.arrived), cell(judged.result.outside);
  out << " | " << std::setprecision(4) << judged.result.miss << " | " << std::setprecision(1) << judged.seconds
      << " |\n";
  return out.str();
}

constexpr const char* table_head =
    "| case | edited, dB | SSIM | vacated, dB | SSIM | arrived, dB | SSIM | outside, dB | SSIM | miss | s |\n"
    "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n";

Result<void> run(const BenchOptions& options, Terminal& terminal) {
  if (auto made = make_folder(options.out); !made) return made;
  return compute(options.compute, [&](const Machine& machine) -> Result<void> {
    std::string table = table_head;
    ordered_json all = ordered_json::array();
    terminal.out << table_head << std::flush;
    for (const std::string& name : options.cases.empty() ? evaluate::case_names() : options.cases) {
      const auto made = evaluate::make_case(name);
      if (!made) return propagate(made);
      if (options.small && !made->small) continue;
      const auto judged = judge(*made, options);
      if (!judged) return propagate(judged);
      table += row(name, *judged);
      terminal.out << row(name, *judged) << std::flush;
      all.push_back(judged->json);
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
  command->add_option("--out", options->out, "Folder for bench.json, bench.md and pictures")
      ->required()
      ->type_name("DIR");
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
