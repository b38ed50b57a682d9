#include "engine/captures/capture_trial.h"

#include <algorithm>
#include <iomanip>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <sstream>
#include <utility>

#include "engine/captures/photographs.h"
#include "engine/core/rows.h"
#include "engine/edit/preview.h"
#include "engine/mask/mask.h"
#include "engine/render/forward.h"
#include "engine/scene/overlay.h"
#include "engine/working/footprint.h"

namespace engine::captures {
namespace {

/// What the held-out cameras should show. What no photo before the edit shows is nobody's fault: it does not count as
/// outside.
std::vector<evaluate::JudgedView> true_views(const CapturedCase& the_case) {
  std::vector<evaluate::JudgedView> views;
  render::Workspace workspace;
  for (const scene::Camera& camera : the_case.held_out) {
    evaluate::JudgedView view{camera, true_photograph(the_case, Side::after, camera),
                              evaluate::judged_regions({the_case.before, the_case.part_before},
                                                       {the_case.after, the_case.part_after}, camera)};
    const scene::Mask shown = mask::mask2d(working::footprint(the_case.before, the_case.shown, camera, workspace));
    for (std::size_t i = 0; i < shown.data.size(); ++i)
      if (shown.data[i] == 0) view.regions.outside.data[i] = 0;
    views.push_back(std::move(view));
  }
  return views;
}

/// Rows of the part after the edit that photos before it show.
std::vector<std::uint32_t> shown_part(const CapturedCase& the_case) {
  std::vector<std::uint32_t> rows;
  std::set_intersection(the_case.part_before.begin(), the_case.part_before.end(), the_case.shown.begin(),
                        the_case.shown.end(), std::back_inserter(rows));
  return rows;
}

/// PSNR of the edited region at the views outside the orbit.
double beyond_db(const ReadyCase& ready, const scene::GaussianCloud& result) {
  const std::span<const evaluate::JudgedView> views = ready.judged.judged;
  return evaluate::judge(views.last(ready.beyond), result).edited.psnr_db;
}

}  // namespace

Result<TrainedCase> train(const CapturedCase& the_case, const fit::FitOptions& options,
                          const std::filesystem::path& folder) {
  auto before = trained(capture(the_case, Side::before), options, folder);
  if (!before) return propagate(before);
  auto after = trained(capture(the_case, Side::after), options, folder);
  if (!after) return propagate(after);
  std::vector<double> shown = shown_areas(before->cloud, the_case.cameras);
  return TrainedCase{std::move(*before), std::move(*after), std::move(shown), true_views(the_case)};
}

Result<ReadyCase> make_ready(const CapturedCase& the_case, const TrainedCase& trained, const GraspBy& grasp_by) {
  const auto& [before, after, shown, views] = trained;
  auto grasp = grasp_by(the_case, before.cloud);
  if (!grasp) return propagate(grasp);

  ReadyCase out;
  out.match = match(before.cloud, grasp->rows, the_case.moving, opacities_times_area(before.cloud));
  out.shown = match(before.cloud, grasp->rows, the_case.moving, shown);
  out.grasp = std::move(*grasp);
  evaluate::Case& judged = out.judged;
  judged.name = the_case.name, judged.what = the_case.what, judged.textured = the_case.textured;
  judged.part_before = marked_rows(the_case.moving.holds(before.cloud.mean));
  judged.before = before.cloud;
  judged.truth = the_case.after;
  judged.part = the_case.part_after;
  judged.part_after = shown_part(the_case);
  judged.cameras = the_case.cameras, judged.held_out = the_case.held_out;
  judged.judged = views;
  judged.request = out.grasp.request;
  out.beyond = the_case.beyond;
  out.ceiling = after.cloud;
  out.ceiling_gaussians = out.ceiling.size();
  out.is_test = the_case.is_test, out.said = the_case.said;
  out.fit_seconds = before.seconds + after.seconds;
  out.key_before = before.key, out.key_after = after.key;
  return out;
}

double CaptureTrial::gain_db() const { return trial.result.edited.psnr_db - deformed.edited.psnr_db; }

double CaptureTrial::least_gain_db() const {
  double least = gain_db();
  for (const auto region : {&evaluate::Quality::vacated, &evaluate::Quality::arrived, &evaluate::Quality::outside})
    if ((deformed.*region).pixels > 0)
      least = std::min(least, (trial.result.*region).psnr_db - (deformed.*region).psnr_db);
  return least;
}

std::optional<double> CaptureTrial::vacated_gain_db() const {
  if (deformed.vacated.pixels == 0) return std::nullopt;
  return trial.result.vacated.psnr_db - deformed.vacated.psnr_db;
}

std::optional<double> CaptureTrial::vacated_share() const {
  const double way = ceiling.vacated.psnr_db - deformed.vacated.psnr_db;
  const std::optional<double> gain = vacated_gain_db();
  if (!gain || !(way > 0)) return std::nullopt;
  return *gain / way;
}

std::optional<double> CaptureTrial::share_of_ceiling() const {
  const double way = ceiling.edited.psnr_db - trial.untouched.edited.psnr_db;
  if (!(way > 0)) return std::nullopt;
  return (trial.result.edited.psnr_db - trial.untouched.edited.psnr_db) / way;
}

Result<CaptureOutcome> carry_out(const ReadyCase& ready, const edit::Request& request, const edit::Request& preview,
                                 const std::string& corrector) {
  auto done = evaluate::carry_out(ready.judged, request, corrector);
  if (!done) return propagate(done);
  const auto base = std::make_shared<const scene::GaussianCloud>(ready.judged.before);
  const auto shown = edit::preview({.base = base, .overlay = nullptr}, preview);
  if (!shown) return propagate(shown);
  const scene::GaussianCloud deformed = scene::flatten(*base, shown->overlay);

  CaptureOutcome out{.trial = {}, .edited = std::move(done->edited)};
  CaptureTrial& trial = out.trial;
  trial.trial = std::move(done->trial);
  trial.is_test = ready.is_test, trial.by = ready.grasp.by, trial.said = ready.said;
  const evaluate::JudgedViews views(ready.judged);
  trial.deformed = evaluate::judge(views, deformed);
  trial.ceiling = evaluate::judge(views, ready.ceiling);
  trial.untouched_beyond_db = beyond_db(ready, ready.judged.before);
  trial.deformed_beyond_db = beyond_db(ready, deformed);
  trial.result_beyond_db = beyond_db(ready, out.edited);
  trial.ceiling_beyond_db = beyond_db(ready, ready.ceiling);
  trial.match = ready.match, trial.shown = ready.shown;
  trial.fit_seconds = ready.fit_seconds;
  return out;
}

std::string capture_table_head() {
  return "| case | set | by | corrector | before, dB | deformed, dB | edited, dB | gain, dB | least gain, dB "
         "| ceiling, dB | share, % | beyond, dB | outside, dB | vacated, dB | vacated gain, dB | vacated share, % "
         "| vacated detail, % "
         "| arrived, dB | SSIM | recall, % | precision, % | recall of shown, "
         "% "
         "| precision of shown, % | s |\n"
         "| --- | --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: "
         "| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n";
}

std::string capture_table_row(const CaptureTrial& trial) {
  const evaluate::Quality& result = trial.trial.result;
  std::ostringstream out;
  out << std::fixed;
  const auto number = [&](bool is_known, double value, int digits) {
    out << " | ";
    if (is_known)
      out << std::setprecision(digits) << value;
    else
      out << '-';
  };
  out << "| " << trial.trial.name << " | " << (trial.is_test ? "test" : "choose") << " | " << trial.by << " | "
      << trial.trial.corrector;
  for (const double db : {trial.trial.untouched.edited.psnr_db, trial.deformed.edited.psnr_db, result.edited.psnr_db,
                          trial.gain_db(), trial.least_gain_db(), trial.ceiling.edited.psnr_db})
    number(true, db, 2);
  const std::optional<double> share = trial.share_of_ceiling();
  number(share.has_value(), 100 * share.value_or(0), 0);
  number(trial.ceiling_beyond_db > 0, trial.result_beyond_db, 2);  // else no camera is outside the orbit
  number(result.outside.pixels > 0, result.outside.psnr_db, 2);
  number(result.vacated.pixels > 0, result.vacated.psnr_db, 2);
  const std::optional<double> vacated_gain = trial.vacated_gain_db(), vacated_share = trial.vacated_share();
  number(vacated_gain.has_value(), vacated_gain.value_or(0), 2);
  number(vacated_share.has_value(), 100 * vacated_share.value_or(0), 0);
  number(result.vacated.detail.has_value(), 100 * result.vacated.detail.value_or(0), 0);
  number(result.arrived.pixels > 0, result.arrived.psnr_db, 2);
  number(true, result.edited.ssim, 4);
  for (const Match& match : {trial.match, trial.shown}) {
    number(true, 100 * match.recall, 0);
    number(true, 100 * match.precision, 0);
  }
  number(true, trial.trial.seconds, 1);
  out << " |\n";
  return out.str();
}

}  // namespace engine::captures
