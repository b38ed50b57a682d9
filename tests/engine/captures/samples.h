// A small scene and cameras around it, for tests of captures.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "engine/captures/captured_case.h"
#include "engine/core/rng.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::captures {

/// 200 opaque Gaussians within a box of side 2 around the origin.
inline scene::GaussianCloud sample_cloud() {
  scene::GaussianCloud cloud;
  cloud.sh_degree = 0;
  cloud.resize(200);
  Rng rng(1);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.mean.set(i, {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)});
    cloud.log_scale.set(i, {rng.uniform(-3, -2), rng.uniform(-3, -2), rng.uniform(-3, -2)});
    cloud.rotation.set(i, {rng.normal(), rng.normal(), rng.normal(), rng.normal()});
    cloud.opacity_logit[i] = 3;
    for (float& value : cloud.sh_row(i)) value = rng.uniform(-1.0f, 1.5f);
  }
  return cloud;
}

inline scene::Camera sample_camera(int number) {
  const double angle = 0.3 * number;
  scene::Camera camera =
      scene::look_at({4 * std::sin(angle), -0.4, -4 * std::cos(angle)}, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 48);
  camera.name = "photo_" + std::to_string(number);
  return camera;
}
inline std::vector<scene::Camera> sample_cameras(int count) {
  std::vector<scene::Camera> cameras;
  for (int i = 0; i < count; ++i) cameras.push_back(sample_camera(i));
  return cameras;
}

/// Photos of the sample scene, and points in it.
inline Capture sample_capture(int views = 4) {
  return {take_photos(sample_cloud(), sample_cameras(views), Sensor{}, 1),
          sparse_points(sample_cloud(), sample_cameras(views), PointOptions{}, 1)};
}

}  // namespace engine::captures
