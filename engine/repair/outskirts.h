// Which rows belong to what a part shows, other than those that were selected.
//
// A trainer explains the outline of a thing by Gaussians that nobody sees whole: large ones of its colour behind it,
// which show through it and around its rim, and ones of the thing itself that are buried in what it stands on or hangs
// before. When the thing goes, the former stay as its outline in the air; the latter come out, and are a haze around
// it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::repair {

/// Rows by what pictures show of them. All ascending.
struct Outskirts {
  std::vector<std::uint32_t>
      backing;  ///< Not of the part: what is seen of them is mostly seen on the part, from behind.
  std::vector<std::uint32_t> buried;  ///< Of the part: no picture shows them, and without the rest they stick out.
};

/// Looks at a part from up to 48 of the cameras, in pictures of 320 pixels; three forward passes and two sums of
/// weights for each. Nothing where no camera shows it.
///   part  rows, ascending
[[nodiscard]] Outskirts outskirts_of(const scene::GaussianCloud& scene, std::span<const std::uint32_t> part,
                                     std::span<const scene::Camera> cameras);

}  // namespace engine::repair
