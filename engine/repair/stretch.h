// Step 4, what a drag does to the extents of the copies: a leaf that is drawn out to twice its width keeps its
// Gaussians, which then let the background through between them.
#pragma once

#include <cstddef>
#include "engine/working/working_scene.h"

namespace engine::repair {

using working::WorkingScene;

/// Draws the covariance of each copy out (or together) as the last deformation has drawn its surroundings:
/// Sigma' = S Sigma S^T, S the linear map that fits what its nearest copies did, from mean_at_deform to mean, beyond
/// turning. A copy stays as it is where they only turned, and where they did not move like one piece: there the surface
/// is torn, and no larger Gaussian would be right.
/// Returns how many changed.
/// Source: the covariance of a Gaussian under a linear map, as in Zwicker et al. 2001, "EWA volume splatting".
std::size_t draw_out(WorkingScene& working);

}  // namespace engine::repair
