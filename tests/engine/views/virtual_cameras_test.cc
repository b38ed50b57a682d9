#include <gtest/gtest.h>

#include <cmath>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/views/views.h"
#include "tests/support/processor_time.h"

namespace engine::views {
namespace {

using scene::Camera;
using scene::GaussianCloud;

void add(GaussianCloud& cloud, DVec3 mean, double sigma, float opacity_logit = 4.0f) {
  const std::size_t i = cloud.size();
  cloud.resize(i + 1);
  cloud.mean.set(i, Vec3(mean));
  cloud.log_scale.set(i, Vec3(float(std::log(sigma))));
  cloud.rotation.set(i, Quat(1, 0, 0, 0));
  cloud.opacity_logit[i] = opacity_logit;
}

/// A box of walls, 4 x 3 x 4 units, floor at y = 0 and ceiling at y = -3 (y down), with a ball on the floor.
GaussianCloud room(DVec3 offset = DVec3(0), bool ceiling = true) {
  GaussianCloud cloud;
  for (double a = -2; a <= 2; a += 0.1) {
    for (double b = -2; b <= 2; b += 0.1) {
      add(cloud, offset + DVec3(a, 0, b), 0.06);
      if (ceiling) add(cloud, offset + DVec3(a, -3, b), 0.06);
    }
    for (double y = -3; y <= 0; y += 0.1)
      for (const double side : {-2.0, 2.0}) {
        add(cloud, offset + DVec3(side, y, a), 0.06);
        add(cloud, offset + DVec3(a, y, side), 0.06);
      }
  }
  Rng rng(5);
  for (int i = 0; i < 300; ++i) {
    const DVec3 direction = glm::normalize(DVec3(rng.normal(), rng.normal(), rng.normal()));
    add(cloud, offset + DVec3(0.2, -0.3, 0.1) + 0.3 * direction, 0.03);
  }
  return cloud;
}

void expect_usable(const std::vector<Camera>& cameras, const std::vector<DVec3>& points) {
  for (const Camera& camera : cameras) {
    SCOPED_TRACE(camera.name);
    ASSERT_TRUE(scene::validate(camera)) << scene::validate(camera).error().message;
    for (const DVec3& point : points) {
      const DVec3 in_cam = camera.cam_from_world(point);
      ASSERT_GT(in_cam.z, 0);
      const DVec2 pixel = camera.pixel_from_cam(in_cam);
      EXPECT_GE(pixel.x, 0);
      EXPECT_GE(pixel.y, 0);
      EXPECT_LE(pixel.x, camera.width);
      EXPECT_LE(pixel.y, camera.height);
    }
  }
}

TEST(VirtualCameras, HoldAllHandlesInThePictureAndStayInsideTheRoom) {
  const GaussianCloud cloud = room();
  const std::vector<DVec3> points{{0.2, -0.3, 0.1}, {0.9, -0.3, -0.4}};
  const auto cameras = virtual_cameras(cloud, points, {.count = 24, .radius = 0.35});
  ASSERT_EQ(cameras.size(), 24u);
  expect_usable(cameras, points);
  for (const Camera& camera : cameras) {
    SCOPED_TRACE(camera.name);
    const DVec3 eye = camera.centre();
    EXPECT_LT(std::abs(eye.x), 1.95);
    EXPECT_LT(std::abs(eye.z), 1.95);
    EXPECT_LT(eye.y, -0.3);
    EXPECT_GT(eye.y, -2.95);
  }
}

/// A dense ball of Gaussians around the points: from no side can they be seen, so that all directions are tried.
GaussianCloud ball(std::size_t count) {
  GaussianCloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const double turn = 2.399963 * double(i), height = 1 - 2 * (double(i) + 0.5) / double(count);
    const double ring = std::sqrt(1 - height * height), radius = 0.6 + 0.4 * double(i * 7919 % count) / double(count);
    add(cloud, DVec3(ring * std::cos(turn), height, ring * std::sin(turn)) * radius, 0.05);
  }
  return cloud;
}

TEST(VirtualCameras, LookAtNoMoreGaussiansThanTheyMay) {
  const std::vector<DVec3> points{{0, 0, 0}, {0.1, 0, 0}};
  const GaussianCloud many = ball(400'000);
  const auto place = [&](std::size_t most) {
    EXPECT_FALSE(virtual_cameras(many, points, {.count = 20, .radius = 0.05, .max_gaussians = most}).empty());
  };
  const double bounded = support::processor_seconds([&] { place(5'000); }, 4);
  const double all = support::processor_seconds([&] { place(0); });
  EXPECT_LT(bounded, all / 10);
}

TEST(VirtualCameras, AreMuchTheSameFromASample) {
  const GaussianCloud cloud = room();
  const std::vector<DVec3> points{{0.2, -0.3, 0.1}, {0.9, -0.3, -0.4}};
  const VirtualCameraOptions sampled{.count = 24, .radius = 0.35, .max_gaussians = cloud.size() / 3};
  const auto cameras = virtual_cameras(cloud, points, sampled);
  ASSERT_EQ(cameras.size(), 24u);
  expect_usable(cameras, points);
  for (const Camera& camera : cameras) {
    EXPECT_LT(std::abs(camera.centre().x), 1.95) << camera.name;
    EXPECT_LT(std::abs(camera.centre().z), 1.95) << camera.name;
  }
  // At least as many as there are is all of them, to the bit.
  const auto same = virtual_cameras(cloud, points, {.count = 9, .radius = 0.35});
  const auto all_of_them = virtual_cameras(cloud, points, {.count = 9, .radius = 0.35, .max_gaussians = cloud.size()});
  const auto alone = virtual_cameras(cloud, points, {.count = 9, .radius = 0.35, .on_one_thread = true});
  for (std::size_t k = 0; k < same.size(); ++k) {
    EXPECT_EQ(all_of_them[k].translation, same[k].translation);
    EXPECT_EQ(alone[k].translation, same[k].translation);
  }
}

TEST(VirtualCameras, AreGivenUpOnceNobodyWantsThem) {
  int asked = 0;
  const auto cameras =
      virtual_cameras(room(), std::vector<DVec3>{{0.2, -0.3, 0.1}},
                      {.count = 24, .radius = 0.35, .on_one_thread = true, .cancelled = [&] { return ++asked == 3; }});
  EXPECT_TRUE(cameras.empty());
  EXPECT_EQ(asked, 3);
}

TEST(VirtualCameras, AreNamedInOrderAndHaveTheWantedPicture) {
  const auto cameras = virtual_cameras(room(), std::vector<DVec3>{{0.2, -0.3, 0.1}},
                                       {.count = 12, .width = 300, .height = 200, .radius = 0.35});
  ASSERT_EQ(cameras.size(), 12u);
  EXPECT_EQ(cameras[0].name, "virtual_00");
  EXPECT_EQ(cameras[11].name, "virtual_11");
  EXPECT_EQ(cameras[3].width, 300);
  EXPECT_EQ(cameras[3].height, 200);
}

TEST(VirtualCameras, LookFromAllSidesWhenNothingIsInTheWay) {
  GaussianCloud cloud;
  add(cloud, {0, 0, 0}, 0.1);
  add(cloud, {0.3, 0, 0}, 0.1);
  const auto cameras = virtual_cameras(cloud, std::vector<DVec3>{{0, 0, 0}}, {.count = 40, .radius = 0.2});
  ASSERT_EQ(cameras.size(), 40u);
  int quadrants[4] = {};
  for (const Camera& camera : cameras) {
    const DVec3 eye = camera.centre();
    EXPECT_LT(eye.y, 0) << camera.name << " is below the handles";
    ++quadrants[(eye.x > 0) + 2 * (eye.z > 0)];
  }
  for (const int n : quadrants) EXPECT_GE(n, 6);
}

TEST(VirtualCameras, KeepOutOfTheHalfSpaceBehindAWall) {
  // The wall touches the handle's sphere, so that from behind it there is no free distance at all.
  GaussianCloud cloud;
  for (double y = -4; y <= 1; y += 0.1)
    for (double x = -4; x <= 4; x += 0.1) add(cloud, {x, y, 0.4}, 0.06);
  add(cloud, {0, 0, 0}, 0.05);
  const std::vector<DVec3> points{{0, 0, 0}, {0.1, 0, 0}};
  const auto cameras = virtual_cameras(cloud, points, {.count = 20, .radius = 0.2});
  ASSERT_EQ(cameras.size(), 20u);
  for (const Camera& camera : cameras) EXPECT_LT(camera.centre().z, 0.4) << camera.name;
}

TEST(VirtualCameras, FollowTheGivenUp) {
  GaussianCloud cloud;
  add(cloud, {0, 0, 0}, 0.1);
  const auto cameras =
      virtual_cameras(cloud, std::vector<DVec3>{{0, 0, 0}}, {.count = 10, .up = {0, 0, 2}, .radius = 0.1});
  ASSERT_EQ(cameras.size(), 10u);
  for (const Camera& camera : cameras) {
    EXPECT_GT(camera.centre().z, 0);
    const DVec2 above = camera.pixel_from_cam(camera.cam_from_world({0, 0, 0.01}));
    EXPECT_LT(above.y, camera.cy);
  }
}

TEST(VirtualCameras, AreTheSameDomeFarFromTheOrigin) {
  // Means are multiples of 1/4, which float still holds exactly at 2e6.
  GaussianCloud near_cloud, far_cloud;
  const DVec3 offset(1e6, -2e6, 5e5);
  for (double a = -2; a <= 2; a += 0.25)
    for (double b = -2; b <= 2; b += 0.25) {
      add(near_cloud, {a, 0.5, b}, 0.2);
      add(far_cloud, offset + DVec3(a, 0.5, b), 0.2);
    }
  const DVec3 from(0.1, -0.2, 0.3), to(0.6, -0.2, 0.3);
  const auto here = virtual_cameras(near_cloud, std::vector{from, to}, {.count = 8, .radius = 0.2});
  const auto there = virtual_cameras(far_cloud, std::vector{offset + from, offset + to}, {.count = 8, .radius = 0.2});
  ASSERT_EQ(here.size(), there.size());
  expect_usable(there, {offset + from, offset + to});
  for (std::size_t i = 0; i < here.size(); ++i)
    EXPECT_LT(glm::length(there[i].centre() - offset - here[i].centre()), 1e-6) << here[i].name;
}

TEST(VirtualCameras, WorkForOneGaussianAndOnePointOnIt) {
  GaussianCloud cloud;
  add(cloud, {3, 4, 5}, 0.01);
  const std::vector<DVec3> points{{3, 4, 5}};
  const auto cameras = virtual_cameras(cloud, points, {.count = 6});
  ASSERT_EQ(cameras.size(), 6u);
  expect_usable(cameras, points);
  for (const Camera& camera : cameras) {
    const double distance = glm::length(camera.centre() - points[0]);
    EXPECT_GT(distance, 0.01);
    EXPECT_LT(distance, 1.0);
  }
}

TEST(VirtualCameras, SeeATinySceneLargeFromBehindTheNearPlane) {
  GaussianCloud cloud;
  for (int i = 0; i < 20; ++i) add(cloud, {0.0005 * i, 0, 0}, 1e-4);
  const std::vector<DVec3> points{{0, 0, 0}, {0.01, 0, 0}};
  const auto cameras = virtual_cameras(cloud, points, {.count = 6, .radius = 0.002});
  ASSERT_EQ(cameras.size(), 6u);
  expect_usable(cameras, points);
  for (const Camera& camera : cameras) {
    EXPECT_GT(camera.cam_from_world(points[0]).z, 0.2);
    EXPECT_GT(camera.cam_from_world(points[1]).z, 0.2);
    const double pixels_per_unit = camera.fx / glm::length(camera.centre() - points[0]);
    EXPECT_GT(0.01 * pixels_per_unit, 0.2 * camera.width) << camera.name;
  }
}

TEST(VirtualCameras, WorkWithoutAnyExtentAtAll) {
  const std::vector<DVec3> points{{1e6, 0, 0}, {1e6, 0, 0}};
  const auto cameras = virtual_cameras(GaussianCloud{}, points, {.count = 5});
  ASSERT_EQ(cameras.size(), 5u);
  expect_usable(cameras, points);
}

TEST(VirtualCameras, WorkForNeedlesHugeSplatsAndZeroQuaternions) {
  GaussianCloud cloud = room();
  cloud.log_scale.set(0, Vec3(40, -60, -60));
  cloud.opacity_logit[0] = -40.0f;
  cloud.rotation.set(1, Quat(0, 0, 0, 0));
  cloud.log_scale.set(1, Vec3(-30, 2, -30));
  const std::vector<DVec3> points{{0.2, -0.3, 0.1}};
  const auto cameras = virtual_cameras(cloud, points, {.count = 5, .radius = 0.35});
  ASSERT_EQ(cameras.size(), 5u);
  expect_usable(cameras, points);
}

TEST(VirtualCameras, StillGiveSomethingToLookThroughWhenWalledIn) {
  GaussianCloud cloud;
  Rng rng(9);
  for (int i = 0; i < 4000; ++i) {  // a solid ball of opaque Gaussians with the handle in its middle
    const DVec3 direction = glm::normalize(DVec3(rng.normal(), rng.normal(), rng.normal()));
    add(cloud, std::cbrt(double(rng.uniform())) * direction, 0.2);
  }
  const std::vector<DVec3> points{{0, 0, 0}};
  const auto cameras = virtual_cameras(cloud, points, {.count = 7, .radius = 0.05});
  ASSERT_EQ(cameras.size(), 7u);
  expect_usable(cameras, points);
}

TEST(VirtualCameras, AreNoneForNoPointsOrNoCount) {
  EXPECT_TRUE(virtual_cameras(room(), {}).empty());
  EXPECT_TRUE(virtual_cameras(room(), std::vector<DVec3>{{0, 0, 0}}, {.count = 0}).empty());
}

TEST(VirtualCameras, FallBackToTheDefaultForAnUpThatNamesNoDirection) {
  GaussianCloud cloud;
  add(cloud, {0, 0, 0}, 0.1);
  const std::vector<DVec3> points{{0, 0, 0}};
  const auto cameras = virtual_cameras(cloud, points, {.count = 4, .up = {0, 0, 0}, .radius = 0.1});
  expect_usable(cameras, points);
  for (const Camera& camera : cameras) EXPECT_LT(camera.centre().y, 0);
}

TEST(VirtualCameras, AreTheSameForAnyNumberOfThreads) {
  const GaussianCloud cloud = room();
  const std::vector<DVec3> points{{0.2, -0.3, 0.1}, {0.9, -0.3, -0.4}};
  std::vector<Camera> one, four;
  WorkArena(1).run([&] { one = virtual_cameras(cloud, points, {.count = 16}); });
  WorkArena(4).run([&] { four = virtual_cameras(cloud, points, {.count = 16}); });
  ASSERT_EQ(one.size(), four.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].translation, four[i].translation);
    EXPECT_EQ(one[i].rotation, four[i].rotation);
  }
}

}  // namespace
}  // namespace engine::views
