// What a linear map makes of a Gaussian's extents.
#pragma once

#include <cstddef>

#include "engine/core/vec.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::scene {

/// Sigma' = S Sigma S^T, in place: rotation and log_scale of the row come anew. A map that mirrors does what it does to
/// the extents, which know no side.
///   map  S; turns, stretches or shears
/// Source: the covariance of a Gaussian under a linear map, as in Zwicker et al. 2001, "EWA volume splatting".
void stretch(GaussianCloud& cloud, std::size_t row, const DMat3& map);

}  // namespace engine::scene
