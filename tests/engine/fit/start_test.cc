#include "engine/fit/start.h"

#include <gtest/gtest.h>

#include <cmath>
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

}  // namespace
}  // namespace engine::fit
