// Scenes and cameras for tests of rendering and of its gradients.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/core/rng.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::render {

inline scene::Camera off_centre_camera(int width = 70, int height = 50) {
  scene::Camera camera = scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1.0, width, height);
  camera.cx += 3.3;  // nothing may assume the middle
  return camera;
}

/// Gaussians in front of that camera, of all sizes; seeded.
inline scene::GaussianCloud cloud_in_view(std::size_t n, std::uint64_t seed, int degree = 3) {
  scene::GaussianCloud cloud;
  cloud.sh_degree = degree;
  cloud.resize(n);
  Rng rng(seed);
  for (std::size_t i = 0; i < n; ++i) {
    const float z = rng.uniform(0.5f, 6.0f);
    cloud.mean.set(i, {z * rng.uniform(-0.9f, 0.9f), z * rng.uniform(-0.7f, 0.7f), z});
    cloud.log_scale.set(i, {rng.uniform(-5.0f, -1.0f), rng.uniform(-5.0f, -1.0f), rng.uniform(-5.0f, -1.0f)});
    cloud.rotation.set(i, {rng.normal(), rng.normal(), rng.normal(), rng.normal()});
    cloud.opacity_logit[i] = rng.uniform(-4.0f, 4.0f);
  }
  for (float& value : cloud.sh) value = 0.4f * rng.normal();
  return cloud;
}

/// A picture of one pixel, whose centre lies on the optical axis: a Gaussian there has its opacity as its alpha.
inline scene::Camera one_pixel_camera() { return scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1.0, 1, 1); }

/// Appends a Gaussian on the optical axis: depth, opacity logit, and one brightness for all channels and directions.
inline void add_on_axis(scene::GaussianCloud& cloud, float depth, float opacity_logit, float brightness,
                        float log_scale = 1.0f) {
  const std::size_t i = cloud.size();
  cloud.resize(i + 1);
  cloud.mean.set(i, {0, 0, depth});
  cloud.log_scale.set(i, Vec3(log_scale));
  cloud.rotation.set(i, {1, 0, 0, 0});
  cloud.opacity_logit[i] = opacity_logit;
  for (float& value : cloud.sh_row(i)) value = 0;
  for (std::size_t c = 0; c < 3; ++c)
    cloud.sh_row(i)[c * scene::sh_coefficients(cloud.sh_degree)] = (brightness - 0.5f) / 0.28209479177387814f;
}

/// Something a file may hold that arithmetic finds hard.
struct Extreme {
  const char* name;
  void (*spoil)(scene::GaussianCloud& cloud, std::size_t row);
};

inline const std::vector<Extreme>& extremes() {
  using Cloud = scene::GaussianCloud;
  static const std::vector<Extreme> all{
      {"NeedlesOfAxisRatioMillion",
       [](Cloud& c, std::size_t i) {
         c.log_scale.set(i, {2.0f, -11.8f, -11.8f});
       }},
      {"SubPixelSplats", [](Cloud& c, std::size_t i) { c.log_scale.set(i, Vec3(-19.0f)); }},
      {"SplatsThatCoverTheScreen", [](Cloud& c, std::size_t i) { c.log_scale.set(i, Vec3(12.0f)); }},
      {"LogScalesBeyondSaturation",
       [](Cloud& c, std::size_t i) {
         c.log_scale.set(i, {3e38f, -3e38f, 50.0f});
       }},
      {"OpacityLogitsBeyondSaturation", [](Cloud& c, std::size_t i) { c.opacity_logit[i] = i % 2 ? 3e38f : -3e38f; }},
      {"JustBeyondTheNearPlane",
       [](Cloud& c, std::size_t i) {
         c.mean.z[i] = std::nextafter(0.2f, 1.0f);
         c.log_scale.set(i, {10.0f, -10.0f, 15.0f});
       }},
      {"AroundAndBehindTheCamera", [](Cloud& c, std::size_t i) { c.mean.z[i] = 0.1f - 0.01f * float(i); }},
      {"MeansAtTheEndOfFloat",
       [](Cloud& c, std::size_t i) {
         c.mean.set(i, {3e38f, i % 2 ? -3e38f : 1.0f, 3e38f});
       }},
      {"MeansAtTheEndOfThePicturePlane",
       [](Cloud& c, std::size_t i) {
         c.mean.set(i, {1e17f, i % 2 ? -1e17f : 1.0f, 1.0f});
         c.log_scale.set(i, Vec3(20.0f));
       }},
      {"ZeroQuaternions",
       [](Cloud& c, std::size_t i) {
         c.rotation.set(i, {0, 0, 0, 0});
       }},
      {"QuaternionsOfLength1e20th", [](Cloud& c, std::size_t i) { c.rotation.set(i, c.rotation.get(i) * 1e-20f); }},
      {"QuaternionsOfLength1e11th", [](Cloud& c, std::size_t i) { c.rotation.set(i, c.rotation.get(i) * 1e-11f); }},
      {"QuaternionsOfLength1e38",
       [](Cloud& c, std::size_t i) {
         c.rotation.set(i, {3e38f, -3e38f, 3e38f, 1e38f});
       }},
      {"ColoursAtTheEndOfFloat",
       [](Cloud& c, std::size_t i) {
         float sign = 1;
         for (float& value : c.sh_row(i)) value = 3e38f * (sign = -sign);
       }},
  };
  return all;
}

}  // namespace engine::render
