// Photographs to fit a scene to, as bytes: what a photo has, at a quarter of the memory of floats.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::fit {

struct Photo {
  scene::Camera camera;
  std::vector<std::uint8_t> rgb;  ///< [3][camera.height][camera.width], display-referred.

  bool operator==(const Photo&) const = default;
};

/// Rounds to bytes.
///   picture  [3], of the camera's size
[[nodiscard]] Photo to_photo(const scene::Camera& camera, const scene::Image& picture);

/// The same, 0 to 1. Overwrites `picture`, whose memory is used again.
void to_image(const Photo& photo, scene::Image& picture);

/// Means of 2 x 2 pixels, and the camera of that picture; an odd last row or column is left out.
/// Precondition: at least 2 pixels a side.
[[nodiscard]] Photo halved(const Photo& photo);

}  // namespace engine::fit
