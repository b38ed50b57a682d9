#include "engine/fit/start.h"

#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <vector>

#include "engine/render/project.h"
#include "engine/scene/sh.h"

namespace engine::fit {
namespace {

/// 4 x 4 x 4 points, `spacing` apart, around `origin`.
std::vector<ColoredPoint> lattice(double spacing, DVec3 origin = DVec3(0.0)) {
  std::vector<ColoredPoint> points;
  for (int x = 0; x < 4; ++x)
    for (int y = 0; y < 4; ++y)
      for (int z = 0; z < 4; ++z)
        points.push_back({origin + spacing * DVec3(x, y, z), {std::uint8_t(60 * x), std::uint8_t(60 * y), 255}});
  return points;
}

TEST(GaussiansAt, AreAsLargeAsTheirNeighboursAreNear) {
  const auto points = lattice(0.5);
  const scene::GaussianCloud cloud = gaussians_at(points, 2);
  ASSERT_EQ(cloud.size(), points.size());
  EXPECT_EQ(cloud.sh_degree, 2);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_EQ(cloud.mean.get(i), Vec3(points[i].position));
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(std::exp(cloud.log_scale.get(i)[axis]), 0.5, 1e-6);
    EXPECT_EQ(cloud.rotation.get(i), Quat(1, 0, 0, 0));
    EXPECT_NEAR(render::opacity(cloud.opacity_logit[i]), 0.1, 1e-6);
  }
}

TEST(GaussiansAt, HaveTheColourOfTheirPointFromEverywhere) {
  const auto points = lattice(0.5);
  const scene::GaussianCloud cloud = gaussians_at(points, 3);
  double basis[16];
  scene::sh_basis(3, 0.6, 0.0, 0.8, basis);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) {
      double color = 0.5;
      for (std::size_t k = 0; k < 16; ++k) color += double(cloud.sh_row(i)[16 * c + k]) * basis[k];
      EXPECT_NEAR(color, points[i].rgb[c] / 255.0, 1e-6);
    }
}

TEST(GaussiansAt, AreOfTheSameSizeFarFromTheOrigin) {
  const scene::GaussianCloud near = gaussians_at(lattice(0.01), 0), far = gaussians_at(lattice(0.01, DVec3(1e6)), 0);
  for (std::size_t i = 0; i < near.size(); ++i) EXPECT_NEAR(far.log_scale.x[i], near.log_scale.x[i], 1e-3f);
}

TEST(GaussiansAt, TakePointsThatCoincideAndPointsThatAreLost) {
  auto points = lattice(0.5);
  for (int i = 0; i < 4; ++i) points.push_back(points[0]);
  points.push_back({DVec3(1e5), {}});
  const scene::GaussianCloud cloud = gaussians_at(points, 0);
  EXPECT_FALSE(scene::first_not_finite(cloud));
  EXPECT_NEAR(std::exp(cloud.log_scale.x[64]), 0.5 * 1e-4, 1e-8) << "one of five points in one place";
  EXPECT_NEAR(std::exp(cloud.log_scale.x[68]), 0.5 * 30, 1e-4) << "a point far from all others";
}

TEST(GaussiansAt, TakeOnePointAndNone) {
  EXPECT_EQ(gaussians_at({}, 0).size(), 0u);
  const scene::GaussianCloud one = gaussians_at(std::vector<ColoredPoint>{{DVec3(1, 2, 3), {1, 2, 3}}}, 0);
  ASSERT_EQ(one.size(), 1u);
  EXPECT_FALSE(scene::first_not_finite(one));
}

TEST(WithShDegree, KeepsWhatBothHave) {
  scene::GaussianCloud cloud;
  cloud.sh_degree = 1;
  cloud.resize(2);
  for (std::size_t i = 0; i < cloud.sh.size(); ++i) cloud.sh[i] = float(i + 1);
  const scene::GaussianCloud more = with_sh_degree(cloud, 3);
  ASSERT_EQ(more.sh.size(), 2u * 48u);
  EXPECT_EQ(more.sh_row(1)[0], 13.0f);
  EXPECT_EQ(more.sh_row(1)[16], 17.0f);
  EXPECT_EQ(more.sh_row(1)[4], 0.0f);
  EXPECT_EQ(with_sh_degree(more, 1), cloud);
  EXPECT_EQ(with_sh_degree(cloud, 0).sh, (std::vector<float>{1, 5, 9, 13, 17, 21}));
}

/// `count` cameras on a ring, `distance` from a point that all look at.
std::vector<scene::Camera> ring(std::size_t count, double distance, DVec3 around) {
  std::vector<scene::Camera> cameras;
  for (std::size_t k = 0; k < count; ++k) {
    const double angle = 6.2831853 * double(k) / double(count);
    const DVec3 eye = around + distance * DVec3(std::cos(angle), -0.3, std::sin(angle));
    cameras.push_back(scene::look_at(eye, around, DVec3(0, -1, 0), 0.8, 64, 48));
  }
  return cameras;
}

TEST(RandomPoints, LieAroundWhatTheCamerasLookAtAndInTheirPictures) {
  for (const DVec3 around : {DVec3(0.0), DVec3(1e6, -2e6, 3e6)}) {
    const auto cameras = ring(9, 4.0, around);
    const auto points = random_points(cameras, 500, 7);
    ASSERT_TRUE(points) << points.error().message;
    ASSERT_EQ(points->size(), 500u);
    DVec3 mean(0.0);
    for (const ColoredPoint& point : *points) {
      mean += (point.position - around) / 500.0;
      EXPECT_LT(glm::distance(point.position, around), 0.5 * 4.0 * std::sqrt(1.09) + 1e-6);
      int seeing = 0;
      for (const scene::Camera& camera : cameras) {
        const DVec2 pixel = camera.pixel_from_cam(camera.cam_from_world(point.position));
        seeing += pixel.x >= 0 && pixel.y >= 0 && pixel.x < 64 && pixel.y < 48;
      }
      EXPECT_GE(seeing, 3);
    }
    EXPECT_LT(glm::length(mean), 0.2) << "not to one side";
  }
}

TEST(RandomPoints, AreThoseOfTheirSeed) {
  const auto cameras = ring(5, 2.0, DVec3(1.0));
  const auto one = random_points(cameras, 50, 1), same = random_points(cameras, 50, 1),
             other = random_points(cameras, 50, 2);
  ASSERT_TRUE(one && same && other);
  for (std::size_t i = 0; i < 50; ++i) EXPECT_EQ((*one)[i].position, (*same)[i].position);
  EXPECT_NE((*one)[0].position, (*other)[0].position);
}

TEST(RandomPoints, NeedCamerasThatLookAtOnePlace) {
  const auto refused = [](std::span<const scene::Camera> cameras) {
    const auto points = random_points(cameras, 10, 0);
    return !points && points.error().code == ErrorCode::unprocessable && points.error().where == "cameras";
  };
  auto cameras = ring(2, 4.0, DVec3(0.0));
  EXPECT_TRUE(refused({}));
  EXPECT_TRUE(refused(std::span(cameras).first(1)));
  const DVec3 up(0, -1, 0);
  cameras = {scene::look_at({0, 0, 0}, {0, 0, 5}, up, 0.8, 64, 48),
             scene::look_at({1, 0, 0}, {1, 0, 5}, up, 0.8, 64, 48)};
  EXPECT_TRUE(refused(cameras)) << "parallel";
  cameras = {scene::look_at({2, 0, 0}, {4, 0, 0}, up, 0.8, 64, 48),
             scene::look_at({0, 0, 2}, {0, 0, 4}, up, 0.8, 64, 48)};
  EXPECT_TRUE(refused(cameras)) << "their axes meet behind them";
}

}  // namespace
}  // namespace engine::fit
