#include "engine/scene/camera.h"

#include <algorithm>
#include <cmath>

namespace engine::scene {

DVec3 Camera::centre() const { return glm::inverse(rotation) * -translation; }
DVec3 Camera::world_from_cam(DVec3 point) const { return glm::inverse(rotation) * (point - translation); }

DVec3 Camera::ray_direction(DVec2 pixel) const {
  return glm::normalize(glm::inverse(rotation) * DVec3((pixel.x - cx) / fx, (pixel.y - cy) / fy, 1.0));
}

Result<void> validate(const Camera& camera) {
  constexpr int max_side = 16384;
  auto bad = [](const char* field, std::string expected) {
    return fail(ErrorCode::invalid_argument, "camera " + std::string(field) + ": " + std::move(expected), field);
  };
  if (camera.width < 1 || camera.width > max_side)
    return bad("width", "expected 1 to 16384 pixels, found " + std::to_string(camera.width));
  if (camera.height < 1 || camera.height > max_side)
    return bad("height", "expected 1 to 16384 pixels, found " + std::to_string(camera.height));
  if (!(std::isfinite(camera.fx) && camera.fx > 0)) return bad("fx", "expected a positive focal length in pixels");
  if (!(std::isfinite(camera.fy) && camera.fy > 0)) return bad("fy", "expected a positive focal length in pixels");
  if (!std::isfinite(camera.cx)) return bad("cx", "expected a finite number of pixels");
  if (!std::isfinite(camera.cy)) return bad("cy", "expected a finite number of pixels");
  for (int column = 0; column < 3; ++column) {
    if (!std::isfinite(camera.translation[column])) return bad("translation", "expected finite numbers");
    for (int row = 0; row < 3; ++row)
      if (!std::isfinite(camera.rotation[column][row])) return bad("rotation", "expected finite numbers");
  }
  // A rotation has determinant 1; half leaves room for matrices printed with few digits, and refuses mirrored or
  // degenerate ones, which have no camera centre or turn the picture inside out.
  if (!(std::abs(glm::determinant(camera.rotation) - 1.0) < 0.5))
    return bad("rotation", "expected a rotation matrix (determinant 1)");
  return {};
}

Camera fit_within(const Camera& camera, int max_side) {
  const int side = std::max(camera.width, camera.height);
  if (side <= max_side) return camera;
  Camera fitted = camera;
  fitted.width = std::max(1, int(std::lround(double(camera.width) * max_side / side)));
  fitted.height = std::max(1, int(std::lround(double(camera.height) * max_side / side)));
  const double scale_x = double(fitted.width) / camera.width, scale_y = double(fitted.height) / camera.height;
  fitted.fx *= scale_x, fitted.cx *= scale_x;
  fitted.fy *= scale_y, fitted.cy *= scale_y;
  return fitted;
}

Camera look_at(DVec3 eye, DVec3 target, DVec3 up, double fov_y_rad, int width, int height) {
  const DVec3 forward = glm::normalize(target - eye);
  DVec3 right = glm::cross(forward, up);
  // Looking straight along `up`, any direction can be right; take the axis that differs most from forward.
  if (glm::length(right) < 1e-9 * glm::length(up)) {
    const DVec3 axis = std::abs(forward.x) < 0.5 ? DVec3(1, 0, 0) : DVec3(0, 1, 0);
    right = glm::cross(forward, axis);
  }
  right = glm::normalize(right);
  const DVec3 down = glm::cross(forward, right);
  Camera camera;
  camera.rotation = glm::transpose(DMat3(right, down, forward));  // rows are the camera's axes
  camera.translation = -(camera.rotation * eye);
  camera.fy = camera.fx = 0.5 * height / std::tan(0.5 * fov_y_rad);
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  camera.width = width;
  camera.height = height;
  return camera;
}

double capture_extent(std::span<const Camera> cameras) {
  DVec3 middle(0.0);
  for (const Camera& camera : cameras) middle += camera.centre() / double(cameras.size());
  double reach = 0;
  for (const Camera& camera : cameras) reach = std::max(reach, glm::distance(camera.centre(), middle));
  return 1.1 * reach;
}

}  // namespace engine::scene
