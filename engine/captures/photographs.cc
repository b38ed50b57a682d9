#include "engine/captures/photographs.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <string>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/core/rows.h"
#include "engine/render/forward.h"
#include "engine/render/largest_weight.h"
#include "engine/scene/sh.h"

namespace engine::captures {
namespace {

// Purposes of derived_seed(): what one seed is asked for.
constexpr std::uint32_t for_exposure = 1, for_noise = 2, for_points = 3;
constexpr int samples_per_side = 2;  // renders per pixel, in a row

// The curve of IEC 61966-2-1: display-referred to linear and back.
float linear_of(float shown) { return shown <= 0.04045f ? shown / 12.92f : std::pow((shown + 0.055f) / 1.055f, 2.4f); }
float shown_of(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}

std::uint8_t byte_of(double value) { return std::uint8_t(std::lround(std::clamp(value, 0.0, 255.0))); }

}  // namespace

Result<void> validate(const Sensor& sensor) {
  struct Field {
    const char* name;
    double value;
  };
  for (const Field& field :
       {Field{"shot_noise", sensor.shot_noise}, Field{"read_noise", sensor.read_noise},
        Field{"exposure_spread", sensor.exposure_spread}, Field{"white_spread", sensor.white_spread}})
    if (!(field.value >= 0 && field.value <= 1))
      return fail(ErrorCode::invalid_argument, "expected a number from 0 to 1, found " + std::to_string(field.value),
                  field.name);
  return {};
}

scene::Image photograph(const scene::GaussianCloud& cloud, const scene::Camera& camera) {
  scene::Camera fine = camera;
  fine.width *= samples_per_side, fine.height *= samples_per_side;
  fine.fx *= samples_per_side, fine.fy *= samples_per_side;
  fine.cx *= samples_per_side, fine.cy *= samples_per_side;
  const scene::Image large = render::forward(cloud, fine).color;
  scene::Image out(camera.width, camera.height, 3);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        float sum = 0;
        for (int j = 0; j < samples_per_side; ++j)
          for (int i = 0; i < samples_per_side; ++i)
            sum += large.at(samples_per_side * x + i, samples_per_side * y + j, c);
        out.at(x, y, c) = std::clamp(sum / float(samples_per_side * samples_per_side), 0.0f, 1.0f);
      }
  return out;
}

std::vector<Vec3> exposures(std::size_t photos, const Sensor& sensor, std::uint64_t seed) {
  std::vector<DVec3> logarithm(photos);
  DVec3 mean(0.0);
  for (std::size_t p = 0; p < photos; ++p) {
    Rng rng(derived_seed(seed, {for_exposure, 0, 0, 0}), p);
    const double whole = sensor.exposure_spread * double(rng.normal());
    for (int c = 0; c < 3; ++c) logarithm[p][c] = whole + sensor.white_spread * double(rng.normal());
    mean += logarithm[p] / double(photos);
  }
  std::vector<Vec3> out;
  out.reserve(photos);
  for (const DVec3& value : logarithm) out.emplace_back(glm::exp(value - mean));
  return out;
}

fit::Photo expose(const scene::Camera& camera, const scene::Image& picture, Vec3 exposure, const Sensor& sensor,
                  std::uint64_t seed) {
  assert(picture.width == camera.width && picture.height == camera.height && picture.channels == 3);
  scene::Image exposed(camera.width, camera.height, 3);
  const auto width = std::size_t(camera.width);
  parallel_for(3 * std::size_t(camera.height), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      Rng rng(seed, row);
      const float gain = exposure[int(row / std::size_t(camera.height))];
      for (std::size_t i = row * width; i < (row + 1) * width; ++i) {
        const double light = double(gain * linear_of(picture.data[i]));
        const double variance = sensor.read_noise * sensor.read_noise + sensor.shot_noise * light;
        const double noisy = light + std::sqrt(variance) * double(rng.normal());
        exposed.data[i] = shown_of(float(std::clamp(noisy, 0.0, 1.0)));
      }
    }
  });
  return fit::to_photo(camera, exposed);
}

std::vector<fit::Photo> take_photos(const scene::GaussianCloud& cloud, std::span<const scene::Camera> cameras,
                                    const Sensor& sensor, std::uint64_t seed) {
  const std::vector<Vec3> exposure = exposures(cameras.size(), sensor, seed);
  std::vector<fit::Photo> photos;
  photos.reserve(cameras.size());
  for (std::size_t p = 0; p < cameras.size(); ++p)
    photos.push_back(expose(cameras[p], photograph(cloud, cameras[p]), exposure[p], sensor,
                            derived_seed(seed, {for_noise, std::uint32_t(p), 0, 0})));
  return photos;
}

std::vector<fit::ColoredPoint> sparse_points(const scene::GaussianCloud& cloud, std::span<const scene::Camera> cameras,
                                             const PointOptions& options, std::uint64_t seed) {
  const std::vector<std::uint32_t> visible = rows_where(
      render::largest_weights(cloud, cameras), [&](float weight) { return double(weight) >= options.least_weight; });
  std::vector<fit::ColoredPoint> points;
  const std::size_t count = std::min(options.count, visible.size());
  for (std::size_t k = 0; k < count; ++k) {
    Rng rng(derived_seed(seed, {for_points, 0, 0, 0}), k);
    // One of each `visible.size() / count` neighbours in the list: spread as evenly as the Gaussians are.
    const std::size_t first = k * visible.size() / count, last = (k + 1) * visible.size() / count;
    const std::uint32_t row = visible[first + rng.below(std::uint32_t(last - first))];
    const bool lost = double(rng.uniform()) < options.outlier_share;
    fit::ColoredPoint point{.position = DVec3(cloud.mean.get(row)), .rgb = {}};
    for (int axis = 0; axis < 3; ++axis) {
      point.position[axis] += options.noise * double(rng.normal());
      if (lost) point.position[axis] += options.outlier_reach * double(rng.uniform(-1, 1));
    }
    const std::size_t coefficients = scene::sh_coefficients(cloud.sh_degree);
    for (std::size_t c = 0; c < 3; ++c) {
      const double shown = 0.5 + scene::sh_c0 * double(cloud.sh_row(row)[c * coefficients]);
      point.rgb[c] = byte_of(255 * shown + options.color_noise * double(rng.normal()));
    }
    points.push_back(point);
  }
  return points;
}

}  // namespace engine::captures
