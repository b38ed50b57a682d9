// Where a camera shows a point.
#pragma once

#include <optional>

#include "engine/core/vec.h"
#include "engine/scene/camera.h"

namespace engine::scene {

/// The pixel position of a point in camera space, if it lies before the camera and within its picture.
[[nodiscard]] inline std::optional<DVec2> pixel_in_picture(const Camera& camera, DVec3 point) {
  if (!(point.z > 0)) return std::nullopt;
  const DVec2 pixel = camera.pixel_from_cam(point);
  // Compared as numbers: one far beside the picture has no place that an int could hold.
  if (!(pixel.x >= 0 && pixel.y >= 0 && pixel.x < camera.width && pixel.y < camera.height)) return std::nullopt;
  return pixel;
}

}  // namespace engine::scene
