// Pictures with unknown pixels at half, a quarter, ... of their size.
#pragma once

#include <vector>

#include "engine/scene/image.h"

namespace engine::correct {

/// A picture of which not everything is known.
struct Partial {
  scene::Image picture;  ///< [3]; where nothing is known, anything finite.
  scene::Image known;    ///< [1] 0 to 1: how far a pixel is.
};

/// Half the size, rounded up: means of up to 2 x 2 pixels, weighted by how far they are known.
[[nodiscard]] Partial halved(const Partial& fine);

/// A pixel of the half is set if all of its up to 2 x 2 pixels are.
[[nodiscard]] scene::Mask halved_all(const scene::Mask& fine);

/// Twice the size, cut to width x height, interpolated linearly between the middles of pixels.
[[nodiscard]] scene::Image doubled(const scene::Image& coarse, int width, int height);

/// Steps from pixel to pixel, diagonal ones too, to the nearest pixel that is not set; 0 for those; a side of the
/// picture where all are set.
[[nodiscard]] std::vector<int> depth_within(const scene::Mask& mask);

}  // namespace engine::correct
