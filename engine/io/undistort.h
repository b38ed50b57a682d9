// Lenses of photographs, and the pinhole picture that a photograph becomes without its lens.
// Source: Brown 1966 (radial and tangential), Kannala and Brandt 2006 (fisheye); coefficients as in OpenCV and COLMAP.
#pragma once

#include <array>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::io {

/// The lens models that can be undistorted.
enum class LensModel {
  perspective,  ///< r_d = r (1 + k1 r^2 + k2 r^4 + k3 r^6), plus the tangential terms
  fisheye       ///< r_d = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8), t = atan(r)
};

/// The calibration of a photograph as it was taken. Pixels are counted as in scene::Camera.
struct Lens {
  LensModel model = LensModel::perspective;
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< Pixels.
  int width = 0, height = 0;              ///< Pixels.
  std::array<double, 4> k{};              ///< Radial coefficients; a perspective lens uses the first three.
  std::array<double, 2> p{};              ///< Tangential coefficients, perspective only.

  /// Nothing to undistort.
  [[nodiscard]] bool is_pinhole() const { return model == LensModel::perspective && k == Lens{}.k && p == Lens{}.p; }
  bool operator==(const Lens&) const = default;
};

/// Where the photograph shows the direction (x, y, 1) of camera space. `plane` is (x/z, y/z).
[[nodiscard]] DVec2 photo_from_plane(const Lens& lens, DVec2 plane);

/// The same lens for a photograph that was resized to width x height.
[[nodiscard]] Lens resized(const Lens& lens, int width, int height);

/// The pinhole camera (pose left at the identity) of the undistorted photograph: size, principal point and focal
/// lengths of the lens, except that a lens whose photograph would not fill the picture gets the smallest zoom, the same
/// in x and y, at which every pixel of the picture looks at the photograph.
///   errors  invalid_argument: a number that is not finite or out of range; `where` is the field
///           unsupported: a lens that no zoom up to 4 undistorts
[[nodiscard]] Result<scene::Camera> undistorted_camera(const Lens& lens);

/// What `camera` would have photographed: looks up each of its pixels in the photo, bilinearly. Beyond the photo's edge
/// its nearest pixel is repeated.
///   photo   lens.width x lens.height, any number of channels
///   errors  invalid_argument: the photo has another size
[[nodiscard]] Result<scene::Image> undistort(const scene::Image& photo, const Lens& lens, const scene::Camera& camera);

}  // namespace engine::io
