// Copy and paste: the deformed Gaussians are put beside the old ones.
// Source: 3DGS-Drag (ICLR 2025), section 3.1; what becomes of the old ones in each mode is our decision.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/deform/deform.h"
#include "engine/edit/working_scene.h"

namespace engine::edit {

/// Carries out `deformation`, computed for `rows` (all of P_h, ascending):
/// - a Gaussian that does not move is not copied and stays in P_h;
/// - an input row that moves gets a deformed copy, which takes its place in P_h. The row stays as an original at
/// opacity
///   min(alpha, keep); if alpha is below keep its bytes stay as they are;
/// - a copy that moves again: in a move its successor replaces it (same row); in an extend it stays as the trail, at
///   min(alpha, keep), and its successor is a new row.
/// mean_at_deform of all of P_h becomes the mean before the motion.
///   returns  the rows that hold the deformed copies now, in the order of `rows`
std::vector<std::uint32_t> paste(WorkingScene& working, const deform::Deformation& deformation,
                                 std::span<const std::uint32_t> rows, Mode mode, bool rotate_sh);

}  // namespace engine::edit
