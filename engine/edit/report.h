// What an edit tells about itself.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "engine/core/vec.h"
#include "engine/deform/attach.h"
#include "engine/edit/plan.h"
#include "engine/edit/request.h"

namespace engine::edit {

using deform::Attachment;

/// What is known about one handle once the edit has looked at the scene.
struct HandleReport {
  std::size_t gaussians = 0;     ///< |P_h^i| at the start.
  std::vector<DVec3> relocated;  ///< Position after each interval, world units. An anchor stays where it is.
};

/// One view the edit looks through.
struct ViewReport {
  std::string name;
  double mask_area = 0;  ///< Union of its 2D masks over all intervals, fraction of the picture, 0..1.
};

/// What one view showed of the place that the part has left, at the end of the last correction. Lengths and areas are
/// fractions of the picture.
struct Uncovered {
  std::string view;
  double area = 0;  ///< What the part has left.
  /// What of that could not be completed: no camera has seen what is there, and no surface was found to go on. It was
  /// painted as it may look from this view alone.
  double open = 0;
  DVec2 open_from{0.0}, open_to{0.0};  ///< Corners of the box around it, x to the right and y down.
};

/// Wall time of one stage, seconds.
struct StageTime {
  Stage stage = Stage::assign;
  double seconds = 0;
};

/// Everything a user may want to know afterwards.
struct Report {
  Params resolved;  ///< With every default filled in (intervals is never 0 here).
  std::vector<HandleReport> handles;
  std::size_t crumbs = 0;         ///< Rows that the selection has left out, and that went along or away.
  std::size_t relit = 0;          ///< Rows that the part's shadow has left or reached.
  std::vector<Attachment> parts;  ///< Of Interpolation::arap: how each group moves, and why.
  std::vector<ViewReport> views;
  std::vector<Uncovered> uncovered;  ///< By a move that a corrector has repaired: views that show what the part left.
  std::size_t input_gaussians = 0;
  std::size_t output_gaussians = 0;
  std::size_t changeable = 0;  ///< Size of the 3D mask M at the end.
  std::size_t copies = 0;      ///< New rows in the output: deformed copies, and children that the optimisation added.
  std::size_t seeds = 0;       ///< Of those, as they were made: placed where a surface goes on that nobody has seen.
  std::size_t removed = 0;     ///< Input rows that are not in the output.
  std::vector<double> losses;  ///< Per interval that was optimised: mean over the views of the last epoch.
  std::vector<std::string> warnings;
  std::vector<StageTime> times;
};

}  // namespace engine::edit
