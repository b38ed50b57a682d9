#include "engine/scene/stretch.h"

#include <gtest/gtest.h>

#include <cmath>

namespace engine::scene {
namespace {

GaussianCloud one_gaussian(Vec3 log_scale, Quat rotation) {
  GaussianCloud cloud;
  cloud.resize(1);
  cloud.log_scale.set(0, log_scale);
  cloud.rotation.set(0, rotation);
  return cloud;
}

DMat3 covariance_of(const GaussianCloud& cloud) {
  DMat3 axes = glm::mat3_cast(glm::normalize(DQuat(cloud.rotation.get(0))));
  for (int axis = 0; axis < 3; ++axis) axes[axis] *= std::exp(double(cloud.log_scale.get(0)[axis]));
  return axes * glm::transpose(axes);
}

TEST(Stretch, MapsTheCovariance) {
  GaussianCloud cloud = one_gaussian({-1.0f, -2.0f, -4.0f}, glm::normalize(Quat(0.7f, 0.2f, -0.4f, 0.3f)));
  const DMat3 map(DVec3(1.2, 0.1, 0), DVec3(-0.3, 0.8, 0.2), DVec3(0, 0.4, 2));
  const DMat3 expected = map * covariance_of(cloud) * glm::transpose(map);
  stretch(cloud, 0, map);
  const DMat3 found = covariance_of(cloud);
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) EXPECT_NEAR(found[column][row], expected[column][row], 1e-6) << column << row;
}

TEST(Stretch, HoldsForExtentsFarFromOne) {
  for (const float size : {-60.0f, 60.0f}) {
    GaussianCloud cloud = one_gaussian({size, size - 1, size - 2}, {1, 0, 0, 0});
    stretch(cloud, 0, 2.0 * DMat3(1.0));
    EXPECT_NEAR(cloud.log_scale.get(0).x, size + std::log(2.0f), 1e-4f);
    EXPECT_NEAR(cloud.log_scale.get(0).z, size - 2 + std::log(2.0f), 1e-4f);
  }
}

TEST(Stretch, OfAFlatDiscStaysFinite) {
  GaussianCloud cloud = one_gaussian({0, 0, -300}, {1, 0, 0, 0});
  stretch(cloud, 0, DMat3(DVec3(1, 0, 0), DVec3(0, 1, 0), DVec3(0, 0, 0)));
  for (int axis = 0; axis < 3; ++axis) EXPECT_TRUE(std::isfinite(cloud.log_scale.get(0)[axis])) << axis;
}

}  // namespace
}  // namespace engine::scene
