#include "engine/captures/photographs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "tests/engine/captures/samples.h"

namespace engine::captures {
namespace {

constexpr Sensor no_noise{.shot_noise = 0, .read_noise = 0, .exposure_spread = 0, .white_spread = 0};

scene::Camera camera_of(int width, int height) {
  scene::Camera camera = sample_camera(0);
  camera.width = width, camera.height = height;
  return camera;
}

double linear_of(double shown) { return std::pow((shown + 0.055) / 1.055, 2.4); }
double shown_of(double linear) { return 1.055 * std::pow(linear, 1 / 2.4) - 0.055; }

struct Statistics {
  double mean = 0, deviation = 0;
};
Statistics of(const std::vector<std::uint8_t>& bytes) {
  Statistics out;
  for (const std::uint8_t byte : bytes) out.mean += byte / 255.0 / double(bytes.size());
  for (const std::uint8_t byte : bytes) out.deviation += std::pow(byte / 255.0 - out.mean, 2) / double(bytes.size());
  out.deviation = std::sqrt(out.deviation);
  return out;
}

TEST(Expose, NoiseIsThatOfTheSensor) {
  const Sensor sensor;
  for (const double shown : {0.2, 0.5, 0.8}) {
    const scene::Image flat(160, 120, 3, float(shown));
    const Statistics found = of(expose(camera_of(160, 120), flat, Vec3(1), sensor, 3).rgb);
    const double linear = linear_of(shown), step = 1e-4;
    const double slope = (shown_of(linear + step) - shown_of(linear - step)) / (2 * step);
    const double deviation = slope * std::sqrt(sensor.read_noise * sensor.read_noise + sensor.shot_noise * linear);
    const double rounding = 1 / (255 * std::sqrt(12.0));
    EXPECT_NEAR(found.deviation, std::hypot(deviation, rounding), 0.04 * deviation) << shown;
    EXPECT_NEAR(found.mean, shown, 1e-3) << shown;
  }
}

TEST(Expose, AFactorIsOfLinearLight) {
  const scene::Image flat(8, 6, 3, 0.4f);
  const fit::Photo photo = expose(camera_of(8, 6), flat, Vec3(1.5f, 1.0f, 0.5f), no_noise, 1);
  const std::array<double, 3> factor{1.5, 1.0, 0.5};
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_EQ(photo.rgb[c * 48], std::lround(255 * shown_of(factor[c] * linear_of(0.4)))) << c;
}

TEST(Expose, WithoutNoiseIsThePicture) {
  scene::Image ramp(256, 2, 3);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < 2; ++y)
      for (int x = 0; x < 256; ++x) ramp.at(x, y, c) = float(x) / 255;
  EXPECT_EQ(expose(camera_of(256, 2), ramp, Vec3(1), no_noise, 1).rgb, fit::to_photo(camera_of(256, 2), ramp).rgb);
}

TEST(Expose, WhatIsTooBrightIsWhite) {
  const scene::Image flat(8, 6, 3, 0.9f);
  for (const std::uint8_t byte : expose(camera_of(8, 6), flat, Vec3(4), no_noise, 1).rgb) EXPECT_EQ(byte, 255);
}

TEST(Exposures, DifferFromPhotoToPhotoAndAreOneOnAverage) {
  const Sensor sensor;
  const auto found = exposures(2000, sensor, 5);
  DVec3 mean(0.0);
  double spread = 0, white = 0;
  for (const Vec3& exposure : found) {
    const DVec3 logarithm = glm::log(DVec3(exposure));
    mean += logarithm / 2000.0;
    spread += logarithm.y * logarithm.y / 2000;
    white += std::pow(logarithm.x - logarithm.y, 2) / 2000;
  }
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(mean[c], 0, 1e-6);
  EXPECT_NEAR(std::sqrt(spread), std::hypot(sensor.exposure_spread, sensor.white_spread), 0.003);
  EXPECT_NEAR(std::sqrt(white), std::sqrt(2.0) * sensor.white_spread, 0.002);
  EXPECT_EQ(exposures(2000, sensor, 5), found);
  EXPECT_NE(exposures(2000, sensor, 6), found);
}

TEST(TakePhotos, AreTheSameForAnyThreadsAndOthersForAnotherSeed) {
  const auto take = [](int threads, std::uint64_t seed) {
    std::vector<std::vector<std::uint8_t>> bytes;
    WorkArena(threads).run([&] {
      for (fit::Photo& photo : take_photos(sample_cloud(), sample_cameras(3), Sensor{}, seed))
        bytes.push_back(std::move(photo.rgb));
    });
    return bytes;
  };
  const auto one = take(1, 9);
  EXPECT_EQ(take(4, 9), one);
  EXPECT_NE(take(1, 10), one);
  EXPECT_NE(one[0], one[1]);
}

TEST(Photograph, APixelIsTheMeanOfWhatItCovers) {
  // An edge of something opaque: where it runs through pixels, they take of both sides.
  const scene::Image picture = photograph(sample_cloud(), sample_camera(0));
  ASSERT_EQ(picture.width, sample_camera(0).width);
  ASSERT_EQ(picture.height, sample_camera(0).height);
  std::set<float> values(picture.data.begin(), picture.data.end());
  EXPECT_GE(*values.begin(), 0.0f);
  EXPECT_LE(*values.rbegin(), 1.0f);
  scene::GaussianCloud one = sample_cloud();
  std::vector<std::uint8_t> keep(one.size(), 0);
  keep[0] = 1;
  one = scene::select(one, keep);
  const scene::Camera camera = sample_camera(0);
  const DVec2 expected = camera.pixel_from_cam(camera.cam_from_world(DVec3(one.mean.get(0))));
  const scene::Image splat = photograph(one, camera);
  DVec2 centre(0.0);
  double mass = 0;
  for (int y = 0; y < splat.height; ++y)
    for (int x = 0; x < splat.width; ++x) {
      const double value = double(splat.at(x, y, 0));
      centre += value * DVec2(x + 0.5, y + 0.5), mass += value;
    }
  ASSERT_GT(mass, 0.5);
  EXPECT_LT(glm::distance(centre / mass, expected), 0.1) << "samples lie evenly around a pixel's centre";
}

TEST(SparsePoints, LieOnWhatIsSeenButForNoiseAndOutliers) {
  const auto cameras = sample_cameras(3);
  scene::GaussianCloud cloud = sample_cloud();
  const std::size_t seen = cloud.size();
  const std::vector<std::uint32_t> first{0};
  scene::append_rows(cloud, cloud, first);
  cloud.mean.set(seen, {0, 0, -50});  // behind the cameras
  const PointOptions exact{.count = 1000, .noise = 0, .outlier_share = 0, .outlier_reach = 0, .color_noise = 0};
  const auto points = sparse_points(cloud, cameras, exact, 4);
  ASSERT_GT(points.size(), seen / 4);
  ASSERT_LE(points.size(), seen);
  for (const fit::ColoredPoint& point : points) {
    EXPECT_GT(point.position.z, -40);
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < cloud.size(); ++i)
      nearest = std::min(nearest, glm::distance(point.position, DVec3(cloud.mean.get(i))));
    EXPECT_EQ(nearest, 0);
  }
  PointOptions lost = exact;
  lost.outlier_share = 1, lost.outlier_reach = 0.3;
  const auto strays = sparse_points(cloud, cameras, lost, 4);
  ASSERT_EQ(strays.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_NE(strays[i].position, points[i].position);
    EXPECT_LE(glm::distance(strays[i].position, points[i].position), 0.3 * std::sqrt(3.0) + 1e-6);
  }
  PointOptions few = exact;
  few.count = 5;
  EXPECT_EQ(sparse_points(cloud, cameras, few, 4).size(), 5u);
}

TEST(SparsePoints, AreAsNoisyAsAsked) {
  const PointOptions exact{.count = 1000, .noise = 0, .outlier_share = 0, .outlier_reach = 0, .color_noise = 0};
  PointOptions noisy = exact;
  noisy.noise = 0.02;
  const auto is = sparse_points(sample_cloud(), sample_cameras(3), noisy, 4),
             should_be = sparse_points(sample_cloud(), sample_cameras(3), exact, 4);
  ASSERT_EQ(is.size(), should_be.size());
  double squares = 0;
  for (std::size_t i = 0; i < is.size(); ++i) {
    const DVec3 off = is[i].position - should_be[i].position;
    squares += glm::dot(off, off) / double(3 * is.size());
  }
  EXPECT_NEAR(std::sqrt(squares), 0.02, 0.003);
}

TEST(Sensor, OutOfRangeIsRefusedByName) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(validate(Sensor{}));
  for (const double wrong : {nan, infinity, -0.1, 1.1}) {
    const auto where = [&](double Sensor::*field) {
      Sensor sensor;
      sensor.*field = wrong;
      const auto valid = validate(sensor);
      return valid ? std::string("valid") : valid.error().where;
    };
    EXPECT_EQ(where(&Sensor::shot_noise), "shot_noise");
    EXPECT_EQ(where(&Sensor::read_noise), "read_noise");
    EXPECT_EQ(where(&Sensor::exposure_spread), "exposure_spread");
    EXPECT_EQ(where(&Sensor::white_spread), "white_spread");
  }
}

}  // namespace
}  // namespace engine::captures
