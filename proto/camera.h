// Cameras on the wire.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <variant>

#include "proto/wire.h"

namespace proto {

using Pose = std::array<std::array<double, 4>, 3>;  ///< Rows of [R | t]: x_in_cam = R x_in_world + t; R is a rotation.

constexpr int max_camera_side = 16384;    ///< Pixels; what the engine draws at most (engine/scene/camera.h).
constexpr double default_fov_y_deg = 50;  ///< Vertical field of view; about that of an eye. A choice.

/// Image origin: upper left corner of the upper left pixel (COLMAP). Axes: x right, y down, z forward.
struct PinholeCamera {
  int width = 0, height = 0;  ///< Pixels.
  double fx = 0, fy = 0;      ///< Focal lengths, pixels, 1e-3 or more.
  double cx = 0, cy = 0;      ///< Principal point, pixels.
  Pose cam_from_world{};
  bool operator==(const PinholeCamera&) const = default;
};

/// A camera at `eye` that looks at `target`.
struct LookAtCamera {
  Point eye{}, target{};    ///< World units.
  std::optional<Point> up;  ///< World direction; without one, the scene's.
  double fov_y_deg = default_fov_y_deg;
  int width = 0, height = 0;  ///< Pixels.
  bool operator==(const LookAtCamera&) const = default;
};

using Camera = std::variant<PinholeCamera, LookAtCamera>;

/// What a picture is taken through: one of the scene's views, by name, or a camera of one's own.
using Viewpoint = std::variant<std::string, Camera>;

}  // namespace proto
