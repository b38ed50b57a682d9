#include "engine/scene/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace engine::scene {
namespace {

TEST(LookAt, PutsTheTargetInTheMiddleAndUpUpwards) {
  const Camera camera = look_at({3, -2, 5}, {0, 1, 0}, {0, 0, 1}, 0.8, 640, 480);
  ASSERT_TRUE(validate(camera));
  const DVec2 middle = camera.pixel_from_cam(camera.cam_from_world({0, 1, 0}));
  EXPECT_NEAR(middle.x, 320, 1e-9);
  EXPECT_NEAR(middle.y, 240, 1e-9);
  const DVec2 above = camera.pixel_from_cam(camera.cam_from_world({0, 1, 0.1}));
  EXPECT_LT(above.y, middle.y);
  EXPECT_NEAR(above.x, middle.x, 1e-9);
  EXPECT_LT(glm::length(camera.centre() - DVec3(3, -2, 5)), 1e-12);
}

TEST(LookAt, WorksStraightAlongTheUpAxis) {
  const Camera camera = look_at({0, 0, 4}, {0, 0, 0}, {0, 0, 1}, 0.8, 64, 64);
  EXPECT_TRUE(validate(camera));
}

TEST(Camera, RayDirectionInvertsProjection) {
  const Camera camera = look_at({1, 2, 3}, {-1, 0.5, 0}, {0, -1, 0}, 1.1, 359, 640);
  const DVec2 pixel{17.25, 600.5};
  const DVec3 point = camera.centre() + 2.7 * camera.ray_direction(pixel);
  const DVec2 back = camera.pixel_from_cam(camera.cam_from_world(point));
  EXPECT_NEAR(back.x, pixel.x, 1e-9);
  EXPECT_NEAR(back.y, pixel.y, 1e-9);
  EXPECT_LT(glm::length(camera.world_from_cam(camera.cam_from_world(point)) - point), 1e-12);
}

TEST(ValidateCamera, NamesTheBadField) {
  const Camera good = look_at({0, 0, 4}, {0, 0, 0}, {0, 1, 0}, 0.8, 64, 64);
  Camera camera = good;
  camera.fy = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(validate(camera).error().where, "fy");
  camera = good;
  camera.width = 0;
  EXPECT_EQ(validate(camera).error().where, "width");
  camera = good;
  camera.rotation[0] = DVec3(0);
  EXPECT_EQ(validate(camera).error().where, "rotation");
}

TEST(FitWithin, ScalesTheIntrinsicsWithThePicture) {
  Camera camera = look_at({0, 0, 4}, {0, 0, 0}, {0, 1, 0}, 0.8, 359, 640);
  const Camera fitted = fit_within(camera, 512);
  EXPECT_EQ(fitted.height, 512);
  EXPECT_EQ(fitted.width, 287);
  EXPECT_NEAR(fitted.fx / camera.fx, 287.0 / 359.0, 1e-12);
  EXPECT_NEAR(fitted.cy, 256, 1e-9);
  EXPECT_EQ(fit_within(camera, 1024).width, 359);
}

}  // namespace
}  // namespace engine::scene
