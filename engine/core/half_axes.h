// Half-axes of an ellipse.
#pragma once

#include <cmath>
#include <utility>

#include "engine/core/vec.h"

namespace engine {

/// The half-axes, the longer one first, of the ellipse cos(t) a + sin(t) b: of all such pairs the one at right angles.
[[nodiscard]] inline std::pair<DVec3, DVec3> half_axes(DVec3 a, DVec3 b) {
  const double angle = 0.5 * std::atan2(2 * glm::dot(a, b), glm::dot(a, a) - glm::dot(b, b));
  return {std::cos(angle) * a + std::sin(angle) * b, std::cos(angle) * b - std::sin(angle) * a};
}

}  // namespace engine
