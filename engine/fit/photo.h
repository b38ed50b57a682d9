// Photographs to fit a scene to, as bytes: what a photo has, at a quarter of the memory of floats.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::fit {

/// A photo and its camera.
struct Photo {
  scene::Camera camera;
  std::vector<std::uint8_t> rgb;  ///< [3][camera.height][camera.width], display-referred.
};

/// The photo of a picture, rounded to bytes.
///   picture  [3], of the camera's size
[[nodiscard]] Photo to_photo(const scene::Camera& camera, const scene::Image& picture);

/// The picture of a photo, [3], 0 to 1. Overwrites `picture`, whose memory is used again.
void to_image(const Photo& photo, scene::Image& picture);

/// The photo at half its size: means of 2 x 2 pixels, with the camera to match; an odd last row or column is left out.
/// Precondition: at least 2 pixels a side.
[[nodiscard]] Photo half_size(const Photo& photo);

}  // namespace engine::fit
