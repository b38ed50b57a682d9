// Photographs of made-up scenes, as a camera that people hold takes them: with noise, in an exposure that changes from
// one to the next. And the sparse points that a reconstruction would find in them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/fit/photo.h"
#include "engine/fit/start.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::captures {

/// What a camera adds to what it sees. Noise and exposure act on linear light, where 1 is a pixel that is full.
struct Sensor {
  /// Variance of noise per linear light, 0 to 1: a pixel that is full holds 1 / shot_noise electrons. 2,500 is a phone
  /// indoors; a middle grey comes out with a standard deviation of 2.6 of 255.
  double shot_noise = 4e-4;
  double read_noise = 2e-3;       ///< Standard deviation of noise in the dark, linear light, 0 to 1.
  double exposure_spread = 0.06;  ///< Standard deviation of the natural logarithm of the exposure, 0 to 1. 0.06: 6 %.
  double white_spread = 0.015;    ///< The same of each channel's own: white balance, 0 to 1.
};
/// errors  invalid_argument: `where` is the field
[[nodiscard]] Result<void> validate(const Sensor& sensor);

/// The picture without noise, 0 to 1: means of 2 x 2 renders per pixel, which a pixel of a photo is, too.
[[nodiscard]] scene::Image photograph(const scene::GaussianCloud& cloud, const scene::Camera& camera);

/// Factors of linear light for each photo and channel, whose logarithms have the mean 0: taken together, photos are as
/// bright as the scene.
[[nodiscard]] std::vector<Vec3> exposures(std::size_t photos, const Sensor& sensor, std::uint64_t seed);

/// What the sensor makes of a picture.
///   picture   [3], of the camera's size, 0 to 1, display-referred
///   exposure  factor of linear light per channel
///   returns   the same bytes for the same arguments, for any number of threads
[[nodiscard]] fit::Photo expose(const scene::Camera& camera, const scene::Image& picture, Vec3 exposure,
                                const Sensor& sensor, std::uint64_t seed);

/// A photo from each camera. Precondition: validate(sensor).
[[nodiscard]] std::vector<fit::Photo> take_photos(const scene::GaussianCloud& cloud,
                                                  std::span<const scene::Camera> cameras, const Sensor& sensor,
                                                  std::uint64_t seed);

/// How a reconstruction finds points. Choices, after what COLMAP finds in a few dozen photos of a room.
struct PointOptions {
  std::size_t count = 4000;     ///< At most; a scene of fewer visible Gaussians gives fewer.
  double noise = 0.01;          ///< Standard deviation of each coordinate, world units.
  double outlier_share = 0.02;  ///< Of points that are where nothing is, 0 to 1,
  double outlier_reach = 0.4;   ///< up to this far off, world units.
  double color_noise = 12;      ///< Standard deviation, of 255.
  double least_weight = 0.05;   ///< A Gaussian is found that some photo shows with this weight or more.
};

/// Points on what the cameras see of a scene.
///   returns  the same for the same arguments, for any number of threads
[[nodiscard]] std::vector<fit::ColoredPoint> sparse_points(const scene::GaussianCloud& cloud,
                                                           std::span<const scene::Camera> cameras,
                                                           const PointOptions& options, std::uint64_t seed);

}  // namespace engine::captures
