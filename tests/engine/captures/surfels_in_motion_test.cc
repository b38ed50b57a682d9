#include "engine/captures/surfels_in_motion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/scene/sh.h"
#include "tests/engine/captures/samples.h"

namespace engine::captures {
namespace {

/// A disc of half-axes 0.03 and 0.02, 0.001 thick, somewhere.
scene::GaussianCloud disc() {
  scene::GaussianCloud cloud;
  cloud.sh_degree = 3;
  cloud.resize(1);
  cloud.mean.set(0, {0.3f, -0.2f, 0.5f});
  cloud.rotation.set(0, glm::normalize(Quat(0.8f, 0.1f, -0.5f, 0.3f)));
  cloud.log_scale.set(0, {std::log(0.03f), std::log(0.02f), std::log(0.001f)});
  return cloud;
}

DMat3 covariance(const scene::GaussianCloud& cloud) {
  const DMat3 axes = glm::mat3_cast(glm::normalize(DQuat(cloud.rotation.get(0))));
  const DVec3 extent = glm::exp(DVec3(cloud.log_scale.get(0)));
  DMat3 scaled = axes;
  for (int axis = 0; axis < 3; ++axis) scaled[axis] *= extent[axis];
  return scaled * glm::transpose(scaled);
}

double largest_difference(const DMat3& a, const DMat3& b) {
  double largest = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) largest = std::max(largest, std::abs(a[i][j] - b[i][j]));
  return largest;
}

TEST(CarryAlong, ATurnTurnsTheDisc) {
  const DMat3 turn = glm::mat3_cast(glm::angleAxis(0.7, glm::normalize(DVec3(1, 2, -1))));
  const DVec3 shift(0.1, 0.2, 0.3);
  scene::GaussianCloud cloud = disc();
  carry_along([&](DVec3 point) { return turn * point + shift; }, 0, cloud);
  EXPECT_LT(glm::distance(DVec3(cloud.mean.get(0)), turn * DVec3(disc().mean.get(0)) + shift), 1e-6);
  EXPECT_LT(largest_difference(covariance(cloud), turn * covariance(disc()) * glm::transpose(turn)), 1e-8);
  const auto normal = [](const scene::GaussianCloud& of) {
    return glm::mat3_cast(glm::normalize(DQuat(of.rotation.get(0))))[2];
  };
  EXPECT_LT(glm::distance(normal(cloud), turn * normal(disc())), 1e-5) << "the same side faces outwards";
}

TEST(CarryAlong, ASurfaceThatGrowsStaysClosed) {
  scene::GaussianCloud cloud = disc();
  carry_along([](DVec3 point) { return 1.5 * point; }, 0, cloud);
  const Vec3 extent = glm::exp(cloud.log_scale.get(0));
  EXPECT_NEAR(double(extent.x), 0.045, 1e-6);
  EXPECT_NEAR(double(extent.y), 0.030, 1e-6);
  EXPECT_NEAR(double(extent.z), 0.001, 1e-6) << "it is no thicker";
}

TEST(CarryAlong, AShearDrawsTheDiscOutWithItsSurface) {
  const DMat3 shear(DVec3(1, 0, 0), DVec3(0.6, 1, 0), DVec3(0, 0.3, 1));
  scene::GaussianCloud cloud = disc(), flat = disc();
  carry_along([&](DVec3 point) { return shear * point; }, 0, cloud);
  // Without its thickness, which is not sheared.
  for (scene::GaussianCloud* one : {&cloud, &flat}) {
    Vec3 extent = one->log_scale.get(0);
    extent.z = -20;
    one->log_scale.set(0, extent);
  }
  EXPECT_LT(largest_difference(covariance(cloud), shear * covariance(flat) * glm::transpose(shear)), 1e-8);
}

/// What gloss adds along a direction of view.
double gloss_along(const scene::GaussianCloud& cloud, DVec3 direction) {
  std::array<double, 16> basis{};
  scene::sh_basis(3, direction.x, direction.y, direction.z, basis.data());
  double sum = 0;
  for (std::size_t k = 0; k < 16; ++k) sum += basis[k] * double(cloud.sh_row(0)[k]);
  return sum;
}

TEST(AddGloss, GleamsWhereTheLightIsMirrored) {
  scene::GaussianCloud cloud = disc();
  const DVec3 normal = glm::mat3_cast(glm::normalize(DQuat(cloud.rotation.get(0))))[2];
  const DVec3 beside = glm::normalize(glm::cross(normal, DVec3(1, 0, 0)));
  const DVec3 to_light = glm::normalize(normal + 0.8 * beside), to_eye = glm::normalize(normal - 0.8 * beside);
  add_gloss(Vec3(to_light), 0.25f, 0, cloud);
  EXPECT_NEAR(gloss_along(cloud, -to_eye), 0.25, 1e-4);
  for (const DVec3& elsewhere : {normal, to_light, beside, -to_eye + 0.5 * beside, -normal})
    if (glm::distance(glm::normalize(elsewhere), -to_eye) > 0.1) {
      EXPECT_LT(gloss_along(cloud, glm::normalize(elsewhere)), 0.24);
    }
  EXPECT_EQ(cloud.sh_row(0)[0], 0.0f) << "no brighter on average";
  EXPECT_NE(cloud.sh_row(0)[12], 0.0f) << "of degree 3";
}

TEST(AddGloss, WhatIsTurnedFromTheLightDoesNotGleam) {
  scene::GaussianCloud cloud = disc();
  const DVec3 normal = glm::mat3_cast(glm::normalize(DQuat(cloud.rotation.get(0))))[2];
  add_gloss(Vec3(-normal), 0.25f, 0, cloud);
  EXPECT_EQ(cloud, disc());
}

}  // namespace
}  // namespace engine::captures
