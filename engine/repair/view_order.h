// In which order views are corrected, and which views are alike.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "engine/scene/camera.h"

namespace engine::repair {

/// All views: view `from`, then always the one whose camera is nearest to one already there, so that a view that
/// decides what nobody has seen is followed by those that see it nearly from there.
[[nodiscard]] std::vector<std::size_t> outward(std::span<const scene::Camera> views, std::size_t from);

/// Up to `count` views by the distance of their cameras from that of view `to`, which comes first; ties by number.
[[nodiscard]] std::vector<std::size_t> nearest_views(std::span<const scene::Camera> views, std::size_t to,
                                                     std::size_t count);

}  // namespace engine::repair
