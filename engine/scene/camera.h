// Pinhole cameras. Axes as in OpenCV: x right, y down, z forward.
#pragma once

#include <span>
#include <string>

#include "engine/core/result.h"
#include "engine/core/vec.h"

namespace engine::scene {

/// A view of the scene. Pose in double: float would lose 1e-3 world units in a scene 1e4 from its origin.
/// Image origin: the upper left corner of the upper left pixel, whose centre is therefore (0.5, 0.5) (COLMAP).
struct Camera {
  std::string name;           ///< Name of the view: the photo's file name, or "virtual_07".
  DMat3 rotation{1.0};        ///< x_in_cam = rotation * x_in_world + translation
  DVec3 translation{0.0};     ///< World units.
  double fx = 0, fy = 0;      ///< Focal lengths, pixels.
  double cx = 0, cy = 0;      ///< Principal point, pixels.
  int width = 0, height = 0;  ///< Pixels.

  /// Camera centre in world units: the exact solution of rotation * c = -translation.
  [[nodiscard]] DVec3 centre() const;
  [[nodiscard]] DVec3 cam_from_world(DVec3 point) const { return rotation * point + translation; }
  [[nodiscard]] DVec3 world_from_cam(DVec3 point) const;
  /// Pixel position (COLMAP convention) of a point in camera space with z > 0.
  [[nodiscard]] DVec2 pixel_from_cam(DVec3 point) const {
    return {fx * point.x / point.z + cx, fy * point.y / point.z + cy};
  }
  /// Unit direction in world space of the ray through a pixel position (COLMAP convention).
  [[nodiscard]] DVec3 ray_direction(DVec2 pixel) const;
};

/// Finite numbers, a picture of 1 to 16384 pixels a side, positive focal lengths, a rotation that can be inverted.
///   errors  invalid_argument: `where` is the field
[[nodiscard]] Result<void> validate(const Camera& camera);

/// The same view with the picture scaled so that its longer side is at most `max_side` pixels; never enlarges.
[[nodiscard]] Camera fit_within(const Camera& camera, int max_side);

/// A camera at `eye` that looks at `target`; `up` is the world direction that points up in the picture.
/// Principal point in the middle, square pixels, vertical field of view `fov_y_rad`.
[[nodiscard]] Camera look_at(DVec3 eye, DVec3 target, DVec3 up, double fov_y_rad, int width, int height);

/// INRIA's extent of a capture: 1.1 times the largest distance of a camera from their centre, world units. 0 for none.
[[nodiscard]] double capture_extent(std::span<const Camera> cameras);

}  // namespace engine::scene
