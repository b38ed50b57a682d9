// Pictures with unknown pixels at half, a quarter, ... of their size.
#pragma once

#include <vector>

#include "engine/scene/image.h"

namespace engine::correct {

/// A picture with a confidence in each of its pixels.
struct MaskedPicture {
  scene::Image picture;     ///< Any channels. Anything finite where the confidence is 0.
  scene::Image confidence;  ///< [1] 0 to 1: how far a pixel is known.
};

/// Half the size, rounded up: means of up to 2 x 2 pixels, weighted by their confidence.
[[nodiscard]] MaskedPicture half_size(const MaskedPicture& fine);

/// Half the size, rounded up: a pixel is set if all of its up to 2 x 2 pixels are.
[[nodiscard]] scene::Mask half_size_mask(const scene::Mask& fine);

/// Twice the size, cut to width x height, interpolated linearly between the middles of pixels.
[[nodiscard]] scene::Image double_size(const scene::Image& coarse, int width, int height);

/// [height][width] Steps from each pixel to the nearest one that is not set, diagonal steps included: 0 for a pixel
/// that is not set; the picture's longer side where all are set.
[[nodiscard]] std::vector<int> depth_within(const scene::Mask& mask);

}  // namespace engine::correct
