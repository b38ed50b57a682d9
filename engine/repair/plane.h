// The plane that points lie in, about.
#pragma once

#include <span>

#include "engine/core/vec.h"

namespace engine::repair {

struct Plane {
  DVec3 middle{0.0};  ///< The mean of the points.
  DVec3 normal{0.0};  ///< Unit, of either sign: the direction in which they are spread least.
};

/// Precondition: there is a point.
[[nodiscard]] Plane plane_of(std::span<const DVec3> points);

}  // namespace engine::repair
