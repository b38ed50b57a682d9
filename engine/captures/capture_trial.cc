#include "engine/captures/capture_trial.h"

#include <iomanip>
#include <memory>
#include <span>
#include <sstream>
#include <utility>

#include "engine/captures/photographs.h"
#include "engine/edit/preview.h"
#include "engine/scene/overlay.h"

namespace engine::captures {
namespace {

/// What the held-out cameras should show, without noise.
std::vector<evaluate::JudgedView> true_views(const CapturedCase& the_case) {
  std::vector<evaluate::JudgedView> views;
  for (const scene::Camera& camera : the_case.held_out)
    views.push_back({camera, photograph(the_case.after, camera),
                     evaluate::judged_regions({the_case.before, the_case.part_before},
                                              {the_case.after, the_case.part_after}, camera)});
  return views;
}

std::vector<std::uint32_t> rows_that_move(const CapturedCase& the_case, const scene::GaussianCloud& trained) {
  const std::vector<std::uint8_t> moves = the_case.moving.holds(trained.mean);
  std::vector<std::uint32_t> rows;
  for (std::uint32_t row = 0; row < moves.size(); ++row)
    if (moves[row] != 0) rows.push_back(row);
  return rows;
}

/// PSNR of the edited region at the views outside the orbit.
double beyond_db(const ReadyCase& ready, const scene::GaussianCloud& result) {
  const std::span<const evaluate::JudgedView> views = ready.judged.judged;
  return evaluate::judge(views.last(ready.beyond), result).edited.psnr_db;
}

}  // namespace

Result<ReadyCase> make_ready(const CapturedCase& the_case, const fit::FitOptions& options,
                             const std::filesystem::path& folder, const GraspBy& grasp_by) {
  auto before = trained(capture(the_case, Side::before), options, folder);
  if (!before) return propagate(before);
  auto after = trained(capture(the_case, Side::after), options, folder);
  if (!after) return propagate(after);
  auto grasp = grasp_by(the_case, before->cloud);
  if (!grasp) return propagate(grasp);

  ReadyCase out;
  out.match = match(before->cloud, grasp->rows, the_case.moving);
  out.grasp = std::move(*grasp);
  evaluate::Case& judged = out.judged;
  judged.name = the_case.name, judged.what = the_case.what, judged.textured = the_case.textured;
  judged.part_before = rows_that_move(the_case, before->cloud);
  judged.before = std::move(before->cloud);
  judged.truth = the_case.after;
  judged.part = the_case.part_after;
  judged.part_after = the_case.shown_after;
  judged.cameras = the_case.cameras, judged.held_out = the_case.held_out;
  judged.judged = true_views(the_case);
  judged.request = out.grasp.request;
  out.beyond = the_case.beyond;
  out.ceiling = std::move(after->cloud);
  out.ceiling_gaussians = out.ceiling.size();
  out.is_test = the_case.is_test, out.said = the_case.said;
  out.fit_seconds = before->seconds + after->seconds;
  out.key_before = before->key, out.key_after = after->key;
  return out;
}

double CaptureTrial::gain_db() const { return trial.result.edited.psnr_db - deformed.edited.psnr_db; }

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
  trial.is_test = ready.is_test, trial.said = ready.said;
  trial.deformed = evaluate::judge(ready.judged, deformed);
  trial.ceiling = evaluate::judge(ready.judged, ready.ceiling);
  trial.untouched_beyond_db = beyond_db(ready, ready.judged.before);
  trial.deformed_beyond_db = beyond_db(ready, deformed);
  trial.result_beyond_db = beyond_db(ready, out.edited);
  trial.ceiling_beyond_db = beyond_db(ready, ready.ceiling);
  trial.match = ready.match;
  trial.fit_seconds = ready.fit_seconds;
  return out;
}

std::string capture_table_head() {
  return "| case | set | corrector | before, dB | deformed, dB | edited, dB | gain, dB | ceiling, dB | share, % "
         "| beyond, dB | outside, dB | vacated, dB | arrived, dB | SSIM | recall, % | precision, % | s |\n"
         "| --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: "
         "| ---: |\n";
}

std::string capture_table_row(const CaptureTrial& trial) {
  const evaluate::Quality& result = trial.trial.result;
  std::ostringstream out;
  out << "| " << trial.trial.name << " | " << (trial.is_test ? "test" : "choose") << " | " << trial.trial.corrector
      << std::fixed << std::setprecision(2);
  for (const double db : {trial.trial.untouched.edited.psnr_db, trial.deformed.edited.psnr_db, result.edited.psnr_db,
                          trial.gain_db(), trial.ceiling.edited.psnr_db})
    out << " | " << db;
  out << " | " << std::setprecision(0);
  if (const auto share = trial.share_of_ceiling())
    out << 100 * *share;
  else
    out << "-";
  out << std::setprecision(2);
  for (const double db :
       {trial.result_beyond_db, result.outside.psnr_db, result.vacated.psnr_db, result.arrived.psnr_db})
    out << " | " << db;
  out << " | " << std::setprecision(4) << result.edited.ssim << std::setprecision(0) << " | "
      << 100 * trial.match.recall << " | " << 100 * trial.match.precision << " | " << std::setprecision(1)
      << trial.trial.seconds << " |\n";
  return out.str();
}

}  // namespace engine::captures
