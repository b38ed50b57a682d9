#include "engine/evaluate/trial.h"

#include <algorithm>
#include <iomanip>
#include <sstream>
#include <utility>

#include "engine/correct/scene_corrector.h"
#include "engine/edit/edit.h"
#include "engine/evaluate/harmonic_corrector.h"
#include "engine/evaluate/memory_peak.h"
#include "engine/scene/overlay.h"

namespace engine::evaluate {
namespace {

/// Notes the times of an edit, without those of pictures that only the judge asked for.
void add_times(const std::vector<edit::StageTime>& times, Trial& trial) {
  for (const edit::StageTime& time : times) {
    if (time.stage == edit::Stage::pictures) continue;
    trial.stages.push_back(time);
    trial.seconds += time.seconds;
  }
}

}  // namespace

std::unique_ptr<correct::Corrector> corrector_named(const std::string& name) {
  if (name == "scene") return std::make_unique<correct::SceneCorrector>();
  if (name == "harmonic") return std::make_unique<HarmonicCorrector>();
  return nullptr;
}

Result<CarriedOut> carry_out(const Case& the_case, const edit::Request& request, const std::string& corrector,
                             optim::PerceptualLoss* lpips, correct::Repainter* repainter) {
  MemoryPeak memory;
  // What is repainted is completed before, as in edits of the service.
  const auto own = corrector_named(repainter != nullptr ? "scene" : corrector);
  Agreement corrected_views;
  edit::Observer observer;
  observer.moment = [&](const edit::Moment& moment) -> Result<void> {
    memory.note();  // what the judge takes does not count
    if (!moment.pictures.empty() && moment.interval == moment.intervals)
      corrected_views = agreement(the_case, moment.views, moment.pictures);
    memory.forget();
    return {};
  };
  edit::Tools tools{.corrector = own.get(), .repainter = repainter};
  if (request.params.perceptual == params::Perceptual::lpips) tools.perceptual = lpips;
  const auto outcome = edit::run(the_case.before, the_case.cameras, request, tools, observer);
  if (!outcome) return propagate(outcome);
  memory.note();
  CarriedOut done{.trial = {}, .edited = scene::flatten(the_case.before, outcome->overlay)};
  Trial& trial = done.trial;
  trial.name = the_case.name;
  trial.what = the_case.what;
  trial.corrector = corrector;
  trial.textured = the_case.textured;
  trial.gaussians = the_case.before.size();
  trial.part = the_case.part_before.size();
  trial.seeds = outcome->report.seeds;
  for (const edit::Uncovered& view : outcome->report.uncovered) trial.uncovered += view.area, trial.open += view.open;
  trial.intervals = outcome->report.resolved.intervals;
  const JudgedViews views(the_case);
  trial.untouched = judge(views, the_case.before);
  trial.result = judge(views, done.edited);
  if (lpips != nullptr)
    for (const auto& [judged, scene] :
         {std::pair{&trial.untouched_lpips, &the_case.before}, {&trial.lpips, &std::as_const(done.edited)}}) {
      const auto distance = perceptual_distance(views.all(), *scene, *lpips);
      if (!distance) return propagate(distance);
      *judged = *distance;
    }
  trial.corrected_views = corrected_views;
  add_times(outcome->report.times, trial);
  trial.peak_memory_bytes = memory.bytes();
  trial.warnings = outcome->report.warnings;
  return done;
}

Result<void> show_pictures(const Case& the_case, const edit::Request& request, const std::string& corrector,
                           const scene::GaussianCloud& edited, std::size_t count, const Show& show) {
  if (count == 0) return {};
  scene::GaussianCloud deformed = edited;
  if (request.params.iterations > 0) {
    edit::Request deform_only = request;
    deform_only.params.iterations = 0;
    const auto dry = edit::run(the_case.before, the_case.cameras, deform_only);
    if (!dry) return propagate(dry);
    deformed = scene::flatten(the_case.before, dry->overlay);
  }
  for (std::size_t v = 0; v < std::min(count, the_case.held_out.size()); ++v) {
    const scene::Camera& camera = the_case.held_out[v];
    const std::string name = the_case.name + "_" + corrector + "_" + camera.name;
    if (auto shown = show(name, comparison(the_case, deformed, edited, camera)); !shown) return shown;
  }
  return {};
}

std::string trial_table_head() {
  return "| case | corrector | edited, dB | SSIM | vacated, dB | SSIM | arrived, dB | SSIM | outside, dB | SSIM | "
         "LPIPS "
         "| miss | views agree, dB | s |\n"
         "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n";
}

std::string trial_table_row(const Trial& trial) {
  const Quality& quality = trial.result;
  std::ostringstream out;
  out << "| " << trial.name << " | " << trial.corrector << std::fixed;
  for (const RegionQuality* kind : {&quality.edited, &quality.vacated, &quality.arrived, &quality.outside})
    out << " | " << std::setprecision(2) << kind->psnr_db << " | " << std::setprecision(4) << kind->ssim;
  out << " | " << std::setprecision(4);
  if (trial.lpips)
    out << *trial.lpips;
  else
    out << "-";
  out << " | " << quality.miss << " | " << std::setprecision(2);
  if (trial.corrected_views.pixels > 0)
    out << trial.corrected_views.psnr_db;
  else
    out << "-";
  out << " | " << std::setprecision(1) << trial.seconds << " |\n";
  return out.str();
}

}  // namespace engine::evaluate
