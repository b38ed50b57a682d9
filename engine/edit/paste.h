// Step 4, copy and paste: the deformed Gaussians are put beside the old ones.
// Source: 3DGS-Drag (ICLR 2025), section 3.3, eqs. 3 and 4; what becomes of the old ones in each mode is our decision.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/edit/drag.h"
#include "engine/working/mode.h"
#include "engine/working/working_scene.h"

namespace engine::edit {

/// Carries out a motion that was planned for this very scene:
/// - a Gaussian that does not move is not copied and stays in P_h;
/// - an input row that moves gets a deformed copy, which takes its place in P_h. The row stays as an original at
/// opacity
///   min(alpha, keep); if alpha is below keep its bytes stay as they are;
/// - a copy that moves again: in a move its successor replaces it (same row); in an extend it stays as the trail, at
///   min(alpha, keep), and its successor is a new row.
/// - what goes on behind a part that is drawn out becomes rows of its own.
/// mean_at_deform of all of P_h becomes the mean before the motion.
///   returns  the rows that hold the deformed copies now, and what goes on behind them, ascending
std::vector<std::uint32_t> copy_and_paste(WorkingScene& working, const PlannedMotion& motion, Mode mode,
                                          bool rotate_sh);

}  // namespace engine::edit
