// How much of a view each Gaussian makes up, in all and by the pixels of a picture: for saying whose pixels these are.
#pragma once

#include <span>

#include "engine/render/forward.h"
#include "engine/render/layers.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::render {

/// Adds to all[i] the sum over the camera's pixels of row i's blending weights T alpha, and to valued[i] the same sum
/// with each pixel's weight times its value, so that calls for several cameras sum. Costs about a forward pass.
///   value        one channel, of the camera's size, finite; 1 inside and 0 outside to sum over a part of the picture
///   all, valued  [layers.size()], pixels
///   bytes        the same for any number of threads: a tile's sums are floats, and tiles are added in their order
/// Precondition: that of forward().
void add_weight_sums(const Layers& layers, const scene::Camera& camera, const scene::Image& value, Workspace& workspace,
                     std::span<double> all, std::span<double> valued);

}  // namespace engine::render
