// What a drag has left open.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::repair {

/// Those of `left`, rows of the input that have left their place, whose place is empty now: nothing that has arrived is
/// as near to it as its neighbours were. What slides along itself, is stretched or stays beside an anchor leaves open
/// only what it no longer covers.
///   original  the scene as the edit found it, in the frame of the edit
///   left      ascending
///   arrived   [n][3] in that frame
[[nodiscard]] std::vector<std::uint32_t> rows_left_open(const scene::GaussianCloud& original,
                                                        std::span<const std::uint32_t> left,
                                                        std::span<const float> arrived);

/// How far the far side of these rows is in each pixel, world units along the axis: that of the farthest mean within
/// two pixels. 0: there is none. [1]
[[nodiscard]] scene::Image far_side(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                                    const scene::Camera& camera);

/// Pixels that the part has left and that show mere air now: nothing is there, and nothing beside what was left either,
/// all the way, by no crack. There is nothing to complete.
///   empty    pixels that show nothing
///   vacated  pixels that the part has left, of the same size
[[nodiscard]] scene::Mask air(const scene::Mask& empty, const scene::Mask& vacated);

}  // namespace engine::repair
