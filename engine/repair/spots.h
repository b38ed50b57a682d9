// Where a row lies, by more than its middle.
#pragma once

#include <array>
#include <cstddef>

#include "engine/core/vec.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::repair {

/// The middle of a row, and the ends of its two longer axes, a standard deviation away. World units.
[[nodiscard]] std::array<DVec3, 5> spots_of(const scene::GaussianCloud& scene, std::size_t row);

/// The standard deviation of a row along its longest axis, world units.
[[nodiscard]] double longest_axis(const scene::GaussianCloud& scene, std::size_t row);

}  // namespace engine::repair
