// What happens to the Gaussians of a made-up surface when it moves, bends or grows, and how they gleam.
#pragma once

#include <cstddef>
#include <functional>

#include "engine/core/vec.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::captures {

/// Where a point of a thing goes. Smooth within the thing. World units.
using Motion = std::function<DVec3(DVec3 point)>;

/// Row i, a flat disc across its third axis, goes where its surface goes, and is turned and drawn out with it, so that
/// the surface stays closed: the disc's axes follow the motion's derivative. Its colour stays.
void carry_along(const Motion& motion, std::size_t i, scene::GaussianCloud& cloud);

/// Makes row i, a flat disc across its third axis, gleam where it mirrors the light: a lobe around the mirrored light
/// in SH bands 1 to 3, of no mean. Turned from the light, a row stays as it is.
///   to_light  unit
///   strength  how much brighter it is where it gleams most, display-referred
/// Precondition: cloud.sh_degree is 3.
void add_gloss(Vec3 to_light, float strength, std::size_t i, scene::GaussianCloud& cloud);

}  // namespace engine::captures
