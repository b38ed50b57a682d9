// A captured case carried out and judged.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/captures/captured_case.h"
#include "engine/captures/grasp.h"
#include "engine/captures/moving_part.h"
#include "engine/captures/training.h"
#include "engine/core/result.h"
#include "engine/edit/request.h"
#include "engine/evaluate/cases.h"
#include "engine/evaluate/judged_view.h"
#include "engine/evaluate/measure.h"
#include "engine/evaluate/trial.h"

namespace engine::captures {

/// Both scenes of a case, photographed and trained: the same whichever way a request says what moves.
struct TrainedCase {
  Trained before, after;
  std::vector<double> shown;                 ///< What the photos show of each row of `before`: shown_areas().
  std::vector<evaluate::JudgedView> judged;  ///< True photographs from the held-out cameras, after the edit.
};

/// Photographs a case and trains both scenes.
///   folder  of trained(); exists
///   errors  those of trained()
[[nodiscard]] Result<TrainedCase> train(const CapturedCase& the_case, const fit::FitOptions& options,
                                        const std::filesystem::path& folder);

/// A case with its trained scenes, and what is asked for.
struct ReadyCase {
  evaluate::Case judged;   ///< `before` is the trained scene, `truth` the true one after; views show true photographs.
  std::size_t beyond = 0;  ///< So many of the held-out views, the last ones, are outside the orbit.
  scene::GaussianCloud ceiling;  ///< Trained from photos after the edit.
  Grasp grasp;                   ///< What is asked for; its request is that of `judged`.
  Match match;                   ///< Of the grasp with what moves, by opacity times area.
  Match shown;                   ///< The same by what the photos show: without what nobody has seen.
  bool is_test = false;          ///< See CapturedCase.
  std::string said;              ///< See Plan.
  double fit_seconds = 0;        ///< Of both fits, when they were done.
  std::size_t ceiling_gaussians = 0;
  std::uint64_t key_before = 0, key_after = 0;  ///< Of the fits.
};

/// Asks for the edit of a case.
///   trained  train() of the case
///   errors   those of `grasp_by`
[[nodiscard]] Result<ReadyCase> make_ready(const CapturedCase& the_case, const TrainedCase& trained,
                                           const GraspBy& grasp_by);

/// What an edit of a captured case came to. Qualities are over all held-out views but where it says otherwise.
struct CaptureTrial {
  evaluate::Trial trial;       ///< Of the edit, with the columns of every trial; `untouched` is of the trained scene.
  bool is_test = false;        ///< See CapturedCase.
  std::string by;              ///< See Grasp.
  std::string said;            ///< See Plan.
  evaluate::Quality deformed;  ///< Of the deformation alone.
  evaluate::Quality ceiling;   ///< Of the scene that was trained from photos after the edit.
  /// PSNR of the edited region at the views outside the orbit, dB.
  double untouched_beyond_db = 0, deformed_beyond_db = 0, result_beyond_db = 0, ceiling_beyond_db = 0;
  Match match, shown;      ///< See ReadyCase.
  double fit_seconds = 0;  ///< Of both fits.

  [[nodiscard]] double gain_db() const;  ///< Of the edit over deformation alone, in the edited region.
  /// The same in the region where it gains least, be it edited, vacated, arrived or outside: below zero, it did harm.
  [[nodiscard]] double least_gain_db() const;
  /// The same in the vacated region. Nothing where nothing is vacated.
  [[nodiscard]] std::optional<double> vacated_gain_db() const;
  /// What of the gain that the ceiling has there the edit has. Nothing also where the ceiling has none.
  [[nodiscard]] std::optional<double> vacated_share() const;
  /// Of the way from the scene before the edit to the ceiling, in dB of the edited region, the part that the edit goes:
  /// 0 as good as doing nothing, 1 as good as photographing anew. Nothing where the ceiling is no better than that.
  [[nodiscard]] std::optional<double> share_of_ceiling() const;
};

/// Edits a case and judges what comes of it.
///   request  that of the case, with the parameters to try
///   preview  the same with those of a deformation alone
///   errors   those of edit::run()
struct CaptureOutcome {
  CaptureTrial trial;
  scene::GaussianCloud edited;
};
[[nodiscard]] Result<CaptureOutcome> carry_out(const ReadyCase& ready, const edit::Request& request,
                                               const edit::Request& preview, const std::string& corrector);

/// The head of a table of trials in Markdown, and a trial's row of it, each with its line's end.
[[nodiscard]] std::string capture_table_head();
[[nodiscard]] std::string capture_table_row(const CaptureTrial& trial);

}  // namespace engine::captures
