// What an edit does, stage by stage, and how long each stage should take: declared once, before it begins. Progress,
// the time that is left and the estimate of an edit that has not begun all come from here.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

namespace engine::edit {

/// The stages of an edit, by their names on the wire.
enum class Stage : std::uint8_t {
  assign,      ///< Steps 1 and 2: which Gaussians are dragged, in how many intervals.
  views,       ///< Step 5: which cameras the edit looks through.
  deform,      ///< Steps 3 and 4: the deformation, its copies, and their extents.
  mask,        ///< Step 6: what the part covers in each view.
  correct,     ///< Step 7, and the seeds of step 4.
  optimise,    ///< Step 8.
  relocate,    ///< Step 9.
  renders,     ///< The scene is shown to an observer that wants to see it (Observer::moment).
  checkpoint,  ///< The state is handed to an observer that wants to keep it (Observer::interval_done).
  finish,      ///< What has become of the input is put together.
};
constexpr std::size_t stage_count = 10;

[[nodiscard]] std::string_view name_of(Stage stage);
/// The stage of that name; nothing for another text.
[[nodiscard]] std::optional<Stage> stage_named(std::string_view name);

/// What the time of an edit depends on.
struct Workload {
  int intervals = 1;       ///< T
  int corrections = 1;     ///< A, of each interval.
  int iterations = 0;      ///< Of the optimisation, per correction.
  bool corrected = false;  ///< A corrector works on the views.
  bool shown = false;      ///< Moments are shown.
  bool kept = false;       ///< Checkpoints are handed out.
};

/// One stage of one interval.
struct PlannedStage {
  Stage stage = Stage::assign;
  int interval = 0;    ///< 1 to T; 0: of no interval in particular.
  double seconds = 0;  ///< It should take.
};

/// All stages in the order in which run() enters them.
[[nodiscard]] std::vector<PlannedStage> plan_of(const Workload& work);

}  // namespace engine::edit
