// Step 4, seed: new Gaussians where a surface goes on that nobody has seen.
#pragma once

#include <cstddef>

#include "engine/neighbours/point_index.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"
#include "engine/working/working_scene.h"

namespace engine::repair {

using working::WorkingScene;

/// The point of the ray through a pixel position at 1 / inverse_depth world units along the optical axis.
[[nodiscard]] DVec3 point_at(const scene::Camera& camera, DVec2 pixel, double inverse_depth);

/// Appends a Gaussian to M for each pixel at which a surface goes on: flat on the surface, as large as the pixel is
/// there, of the picture's colour.
///   camera         in the frame of the working scene
///   inverse_depth  [1] 0: nothing goes on at this pixel
///   inputs         means of the input's rows: unknown properties, and the name in messages, are the nearest one's
///   returns        how many
std::size_t add_seeds(WorkingScene& working, const scene::Camera& camera, const scene::Image& inverse_depth,
                      const scene::Image& picture, const neighbours::PointIndex& inputs);

}  // namespace engine::repair
