// Where a picture shows a part of a scene, and which rows are before it there.
#pragma once

#include <span>

#include "engine/core/soa.h"
#include "engine/render/forward.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::repair {

/// 1 at pixels that the part covers, and in which it is before what is solid of the rest, else 0. [1]
///   part  with depth, of the part alone
///   rest  with depth, of the scene without it
[[nodiscard]] scene::Image where_shown(const render::Rendering& part, const render::Rendering& rest);

/// Counts the rows whose mean is at such a pixel: before the part, or behind it.
///   means             [N] world units
///   in_front, behind  [N] to add to
void compare_depths(const Array3& means, const scene::Camera& view, const render::Rendering& part,
                    const scene::Image& shown, std::span<int> in_front, std::span<int> behind);

}  // namespace engine::repair
