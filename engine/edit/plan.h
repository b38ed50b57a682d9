// What an edit does, stage by stage, and how long each stage should take: declared once, before it begins. Progress,
// the time that is left and the estimate of an edit that has not begun all come from here.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/names.h"

namespace engine::edit {

/// The stages of an edit, by their names on the wire.
enum class Stage : std::uint8_t {
  assign,      ///< Steps 1 and 2: which Gaussians are dragged, in how many intervals.
  views,       ///< Step 5: which cameras the edit looks through.
  deform,      ///< Steps 3 and 4: the deformation, its copies, and their extents.
  mask,        ///< Step 6: what the part covers in each view.
  observe,     ///< Before the first correction: what cameras have seen of the unedited scene.
  tune,        ///< Before the corrections of an interval: a repainter learns from the history of the edit.
  correct,     ///< Step 7, and the seeds of step 4; of an edit that is repainted, what is completed before.
  repaint,     ///< Step 7 by a repainter: all views.
  set_up,      ///< Before an optimisation: what of each view it keeps, and what it should show.
  optimise,    ///< Step 8.
  relocate,    ///< Step 9.
  pictures,    ///< The scene is shown to an observer that wants to see it (Observer::moment).
  checkpoint,  ///< The state is handed to an observer that wants to keep it (Observer::interval_done).
  finish,      ///< What has become of the input is put together.
};
constexpr auto names_of(Stage) {
  return std::array{Name{Stage::assign, "assign"},         Name{Stage::views, "views"},
                    Name{Stage::deform, "deform"},         Name{Stage::mask, "mask"},
                    Name{Stage::observe, "observe"},       Name{Stage::tune, "tune"},
                    Name{Stage::correct, "correct"},       Name{Stage::repaint, "repaint"},
                    Name{Stage::set_up, "set_up"},         Name{Stage::optimise, "optimise"},
                    Name{Stage::relocate, "relocate"},     Name{Stage::pictures, "pictures"},
                    Name{Stage::checkpoint, "checkpoint"}, Name{Stage::finish, "finish"}};
}
using engine::name_of;
constexpr std::size_t stage_count = names<Stage>.size();
static_assert([] {  // a list of stage_count is indexed by the enumerators
  for (std::size_t k = 0; k < stage_count; ++k)
    if (names<Stage>[k].value != Stage(k)) return false;
  return names<Stage>.back().value == Stage::finish;
}());

/// Time that a whole frame of a scene takes on a machine: a part that goes with the Gaussians, and one that goes with
/// the pixels.
struct FrameTime {
  double gaussians = 0;  ///< Seconds.
  double pixel = 0;      ///< Seconds for each.

  [[nodiscard]] double of(std::size_t pixels) const { return gaussians + pixel * double(pixels); }
};

/// Time that a repainter takes where a plan's figures were measured, seconds.
struct RepaintTime {
  double training_step = 0;  ///< Of fine-tuning.
  double picture = 0;        ///< Of one picture, whatever its strength.
  double full_strength = 0;  ///< Besides, of strength 1; less strength takes as much less.

  [[nodiscard]] double of_picture(double strength) const { return picture + strength * full_strength; }
};

/// What the time of an edit depends on.
struct Workload {
  std::size_t gaussians = 0;    ///< N, of the input.
  std::size_t dragged = 0;      ///< |P_h|
  double covered = 0.1;         ///< Of a picture, 0 to 1: the box around the dragged part.
  int intervals = 1;            ///< T
  int finished = 0;             ///< Of them, before the edit went on from its state.
  int corrections = 1;          ///< A, of each interval.
  int iterations = 0;           ///< Of the optimisation, per correction.
  bool corrected = false;       ///< A corrector works on the views.
  bool repainted = false;       ///< And a repainter after it.
  RepaintTime repaint_time;     ///< If it is known.
  int first_tuning = 0;         ///< Steps of training before the first interval,
  int later_tuning = 0;         ///< and before each later one.
  double mean_strength = 0.5;   ///< Of the corrections of an interval.
  bool vacates = true;          ///< The dragged part leaves its place, which is then filled: a move.
  bool selected = false;        ///< A selection says what leaves, and its outskirts may go with it.
  std::size_t candidates = 0;   ///< C: cameras that are compared.
  bool virtual_views = false;   ///< They have to be found first.
  std::size_t views = 0;        ///< V, that the edit looks through.
  std::size_t view_pixels = 0;  ///< Of one view, as the edit works on it.
  bool shown = false;           ///< Moments are shown,
  std::size_t pictured = 0;     ///< and pictures are made of so many views.
  bool kept = false;            ///< Checkpoints are handed out.
  FrameTime frame;              ///< Of this scene, on this machine as it is now; 0: not measured.
  // What a preview of this drag took, on this machine as it is now (PreviewOutcome); 0: there was none.
  double assign_seconds = 0;  ///< To find what is dragged, and what holds it.
  double drag_seconds = 0;    ///< To take it through all intervals.
  double slowness = 1;        ///< Of this machine as it is now: how many times longer work takes than where the plan's
                              ///< figures were measured.
  /// Of a perceptual loss that is a network, beside the rest of an iteration: for each pixel of the box around the
  /// part, seconds where a plan's figures were measured.
  double perceptual_pixel_seconds = 0;
};

/// One stage of one interval.
struct PlannedStage {
  Stage stage = Stage::assign;
  int interval = 0;    ///< 1 to T; 0: of no interval in particular.
  double seconds = 0;  ///< It should take.
};

/// All stages in the order in which run() enters them. Which stages there are depends on intervals, corrections,
/// iterations, corrected, repainted, finished, shown and kept alone; the rest of the workload decides what they take.
/// Where frames were not measured, those of a middling machine are taken: the stages are right to each other, not their
/// sum.
[[nodiscard]] std::vector<PlannedStage> plan_of(const Workload& work);

/// Seconds that a plan takes, from its first stage to its last one.
[[nodiscard]] double seconds_of(std::span<const PlannedStage> plan);

}  // namespace engine::edit
