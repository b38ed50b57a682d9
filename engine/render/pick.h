// What a pixel shows: for placing points on a scene.
#pragma once

#include <cstdint>
#include <optional>

#include "engine/core/vec.h"
#include "engine/render/forward.h"
#include "engine/render/layers.h"
#include "engine/scene/camera.h"

namespace engine::render {

/// The surface that a pixel shows.
struct PixelHit {
  double depth = 0;       ///< Depth at which transmittance falls below one half, world units along the optical axis.
  DVec3 point{0.0};       ///< On the pixel's ray, at that depth. World units.
  DVec3 normal{0.0};      ///< Unit normal of the surface there, towards the camera.
  std::uint32_t row = 0;  ///< Row of the Gaussian with the largest weight, in the merged cloud (scene::flatten()).
};

/// The surface that shows at a position of the picture (COLMAP convention: the first pixel's centre is at 0.5). Nothing
/// where transmittance stays at one half or more.
///   normal  of the plane that fits the median depths of the pixels around best; at silhouettes, where most of them
///           belong to something else, the shortest axis of the Gaussian with the largest weight
/// Costs one pass over the means; only what reaches the 7 x 7 pixels around is blended, in scalar code: the same for
/// any thread count and instruction set but for the rounding of projection.
/// Precondition: validate(camera) holds; pixel is finite, but may lie outside the picture (which is a miss).
[[nodiscard]] std::optional<PixelHit> pick(const Layers& layers, const scene::Camera& camera, DVec2 pixel,
                                           Workspace& workspace);

}  // namespace engine::render
