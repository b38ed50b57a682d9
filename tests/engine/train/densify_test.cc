#include "engine/train/densify.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/render/project.h"

namespace engine::train {
namespace {

scene::GaussianCloud two() {
  scene::GaussianCloud cloud;
  cloud.extra_stride = 2;
  cloud.resize(2);
  for (std::size_t i = 0; i < 2; ++i) {
    cloud.mean.set(i, {float(i), 2, 3});
    cloud.log_scale.set(i, Vec3(std::log(i == 0 ? 0.01f : 1.0f)));
    cloud.rotation.set(i, {2, 0, 0, 0});
    cloud.opacity_logit[i] = 1;
    cloud.extra[2 * i] = std::byte(7 + i);
  }
  return cloud;
}

TEST(Densify, ClonesSmallGaussiansWithoutChangingHowTheyBlend) {
  scene::GaussianCloud cloud = two();
  Rng rng(1);
  add_children(cloud, std::vector<std::uint32_t>{0}, 0.1, rng);
  ASSERT_EQ(cloud.size(), 3u);
  EXPECT_EQ(cloud.mean.get(2), cloud.mean.get(0));
  EXPECT_EQ(cloud.log_scale.get(2), two().log_scale.get(0));
  const double before = render::opacity<double>(1.0);
  const double through = 1 - render::opacity<double>(double(cloud.opacity_logit[0]));
  EXPECT_NEAR(1 - through * through, before, 1e-6);
  EXPECT_EQ(cloud.opacity_logit[2], cloud.opacity_logit[0]);
}

TEST(Densify, SplitsLargeGaussiansIntoSmallerOnesNearby) {
  scene::GaussianCloud cloud = two();
  Rng rng(1);
  add_children(cloud, std::vector<std::uint32_t>{1}, 0.1, rng);
  ASSERT_EQ(cloud.size(), 3u);
  for (const std::size_t row : {1u, 2u}) {
    EXPECT_NEAR(std::exp(cloud.log_scale.get(row).x), 1 / 1.6, 1e-5);
    EXPECT_LT(glm::distance(cloud.mean.get(row), Vec3(1, 2, 3)), 6);
  }
  EXPECT_NE(cloud.mean.get(1), cloud.mean.get(2));
  EXPECT_EQ(cloud.opacity_logit[2], 1.0f);
  EXPECT_EQ(cloud.mean.get(0), two().mean.get(0));
}

TEST(Densify, ChildrenHaveTheirParentsOtherBytes) {
  scene::GaussianCloud cloud = two();
  Rng rng(1);
  add_children(cloud, std::vector<std::uint32_t>{0, 1}, 0.1, rng);
  EXPECT_EQ(cloud.extra_row(2)[0], std::byte(7));
  EXPECT_EQ(cloud.extra_row(3)[0], std::byte(8));
}

TEST(Densify, OpacitiesAtTheEndsOfTheirRangeStayFinite) {
  for (const float logit : {-1e30f, -31.0f, -12.0f, 12.0f, 31.0f, 1e30f}) {
    scene::GaussianCloud cloud = two();
    cloud.opacity_logit[0] = logit;
    Rng rng(1);
    add_children(cloud, std::vector<std::uint32_t>{0}, 0.1, rng);
    EXPECT_TRUE(std::isfinite(cloud.opacity_logit[0])) << logit;
  }
}

TEST(Densify, TakesTheStrongestWhereThereIsNoRoomForAll) {
  PositionGradientStatistic statistic;
  statistic.reset(5);
  statistic.sum = {4, 9, 1, 9, 20};
  statistic.views = {1, 1, 1, 3, 2};  // means 4, 9, 1, 3, 10
  EXPECT_EQ(rows_to_densify(statistic, 2, 10), (std::vector<std::uint32_t>{0, 1, 3, 4}));
  EXPECT_EQ(rows_to_densify(statistic, 2, 2), (std::vector<std::uint32_t>{1, 4}));
  EXPECT_TRUE(rows_to_densify(statistic, 2, 0).empty());
  EXPECT_TRUE(rows_to_densify(statistic, 10, 10).empty());
}

TEST(Densify, ViewsThatDoNotShowARowDoNotCount) {
  PositionGradientStatistic statistic;
  statistic.reset(2);
  render::Gradients gradients;
  gradients.reset(2, 0);
  gradients.mean2d_x_px = {3, 0}, gradients.mean2d_y_px = {4, 0};
  statistic.add(gradients, scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1.0, 20, 20));
  EXPECT_DOUBLE_EQ(statistic.sum[0], 50);
  EXPECT_EQ(statistic.views[0], 1u);
  EXPECT_EQ(statistic.views[1], 0u);
}

}  // namespace
}  // namespace engine::train
