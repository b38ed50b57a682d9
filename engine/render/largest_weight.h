// How much of each Gaussian a view really shows.
#pragma once

#include <span>
#include <vector>

#include "engine/render/forward.h"
#include "engine/render/layers.h"
#include "engine/scene/camera.h"

namespace engine::render {

/// Raises out[i] to the largest blending weight T alpha of row i over the camera's pixels (0: no pixel shows it), so
/// that calls for several cameras leave the largest over all of them. Costs about a forward pass.
///   out    [layers.size()]
///   bytes  the same for any number of threads
/// Precondition: that of forward().
void raise_to_largest_weights(const Layers& layers, const scene::Camera& camera, Workspace& workspace,
                              std::span<float> out);

/// The largest blending weights of all rows over these cameras. [layers.size()]
/// Precondition: that of forward().
[[nodiscard]] std::vector<float> largest_weights(const Layers& layers, std::span<const scene::Camera> cameras);

}  // namespace engine::render
