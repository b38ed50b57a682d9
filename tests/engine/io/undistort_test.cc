#include "engine/io/undistort.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/core/rng.h"

namespace engine::io {
namespace {

Lens phone() {
  Lens lens;
  lens.fx = 300, lens.fy = 310, lens.cx = 158, lens.cy = 123;
  lens.width = 320, lens.height = 240;
  lens.k = {-0.12, 0.03, 0.002, 0};
  lens.p = {0.004, -0.003};
  return lens;
}

Lens fisheye() {
  Lens lens = phone();
  lens.model = LensModel::fisheye;
  lens.k = {-0.02, 0.004, -0.001, 0.0002};
  lens.p = {};
  return lens;
}

/// A picture whose two channels hold the coordinates of each pixel's centre: undistorting it shows where it looked.
scene::Image coordinates(int width, int height) {
  scene::Image image(width, height, 2);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) image.at(x, y, 0) = float(x) + 0.5f, image.at(x, y, 1) = float(y) + 0.5f;
  return image;
}

TEST(PhotoFromPlane, FollowsBrownsFormulas) {
  const Lens lens = phone();
  const double x = 0.3, y = -0.2, r2 = x * x + y * y;
  const double radial = 1 - 0.12 * r2 + 0.03 * r2 * r2 + 0.002 * r2 * r2 * r2;
  const DVec2 seen = photo_from_plane(lens, {x, y});
  EXPECT_NEAR(seen.x, 300 * (x * radial + 2 * 0.004 * x * y - 0.003 * (r2 + 2 * x * x)) + 158, 1e-10);
  EXPECT_NEAR(seen.y, 310 * (y * radial + 0.004 * (r2 + 2 * y * y) + 2 * -0.003 * x * y) + 123, 1e-10);
}

TEST(PhotoFromPlane, AnEquidistantFisheyeShowsAnglesAsRadii) {
  Lens lens = fisheye();
  lens.k = {};
  lens.fy = lens.fx;
  for (const double angle : {0.0, 1e-9, 1e-4, 0.3, 1.2, 1.5}) {
    SCOPED_TRACE(angle);
    const DVec2 seen = photo_from_plane(lens, {std::tan(angle) * 0.6, std::tan(angle) * -0.8});
    EXPECT_NEAR(seen.x, lens.cx + lens.fx * angle * 0.6, 1e-9);
    EXPECT_NEAR(seen.y, lens.cy - lens.fx * angle * 0.8, 1e-9);
  }
}

TEST(UndistortedCamera, OfAPinholeIsThePinhole) {
  Lens lens = phone();
  lens.k = {}, lens.p = {};
  ASSERT_TRUE(lens.is_pinhole());
  const auto camera = undistorted_camera(lens);
  ASSERT_TRUE(camera);
  EXPECT_EQ(camera->fx, lens.fx);
  EXPECT_EQ(camera->fy, lens.fy);
  EXPECT_EQ(camera->cx, lens.cx);
  EXPECT_EQ(camera->cy, lens.cy);
  EXPECT_EQ(camera->width, 320);
  EXPECT_EQ(camera->height, 240);
}

TEST(UndistortedCamera, KeepsTheFocalLengthWhereThePhotoFillsThePicture) {
  Lens barrel = phone();
  barrel.p = {};
  EXPECT_EQ(undistorted_camera(barrel)->fx, barrel.fx);
  EXPECT_EQ(undistorted_camera(fisheye())->fy, fisheye().fy);
}

TEST(UndistortedCamera, ZoomsJustEnoughToLeaveNoPixelOutsideThePhoto) {
  Lens pincushion = phone();
  pincushion.k = {0.1, 0.02, 0, 0};
  const auto camera = undistorted_camera(pincushion);
  ASSERT_TRUE(camera) << camera.error().message;
  EXPECT_GT(camera->fx, pincushion.fx * 1.001);
  EXPECT_NEAR(camera->fx / pincushion.fx, camera->fy / pincushion.fy, 1e-12);
  double margin = std::numeric_limits<double>::infinity();
  for (int y = 0; y < camera->height; ++y)
    for (int x = 0; x < camera->width; ++x) {
      const DVec2 seen =
          photo_from_plane(pincushion, {(x + 0.5 - camera->cx) / camera->fx, (y + 0.5 - camera->cy) / camera->fy});
      margin = std::min({margin, seen.x, seen.y, 320 - seen.x, 240 - seen.y});
    }
  EXPECT_GT(margin, -1e-3);
  EXPECT_LT(margin, 1e-2);  // and no more zoom than that
}

TEST(UndistortedCamera, RefusesALensThatFolds) {
  Lens lens = phone();
  lens.k = {-40, 0, 0, 0};
  EXPECT_EQ(undistorted_camera(lens).error().code, ErrorCode::unsupported);
  lens.k = {1e300, 0, 0, 0};
  EXPECT_EQ(undistorted_camera(lens).error().code, ErrorCode::unsupported);
  lens = phone();
  lens.cx = 1e6;
  EXPECT_EQ(undistorted_camera(lens).error().code, ErrorCode::unsupported);
}

TEST(UndistortedCamera, NamesTheNumberThatIsNotFinite) {
  Lens lens = phone();
  lens.k[2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(undistorted_camera(lens).error().where, "k3");
  lens = phone();
  lens.p[1] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(undistorted_camera(lens).error().where, "p2");
  lens = phone();
  lens.fx = -1;
  EXPECT_EQ(undistorted_camera(lens).error().where, "fx");
}

TEST(Undistort, ShowsEachPointWhereThePinholeProjectsIt) {
  for (const Lens& lens : {phone(), fisheye()}) {
    SCOPED_TRACE(int(lens.model));
    const auto camera = undistorted_camera(lens);
    ASSERT_TRUE(camera);
    const auto undistorted = undistort(coordinates(lens.width, lens.height), lens, *camera);
    ASSERT_TRUE(undistorted);
    Rng rng(7);
    for (int i = 0; i < 500; ++i) {
      // A point in front of the middle of a pixel: the undistorted photo must hold what the lens projected there.
      const int x = int(rng.below(320)), y = int(rng.below(240));
      const double z = rng.uniform(0.1f, 50.0f);
      const DVec3 point((x + 0.5 - camera->cx) / camera->fx * z, (y + 0.5 - camera->cy) / camera->fy * z, z);
      const DVec2 projected = photo_from_plane(lens, DVec2(point.x, point.y) / point.z);
      SCOPED_TRACE(testing::Message() << x << "," << y);
      EXPECT_NEAR(undistorted->at(x, y, 0), std::clamp(projected.x, 0.5, 319.5), 2e-4);
      EXPECT_NEAR(undistorted->at(x, y, 1), std::clamp(projected.y, 0.5, 239.5), 2e-4);
    }
  }
}

TEST(Undistort, MakesTheBentImageOfAStraightLineStraight) {
  // Photograph the line X = 0.22 of the plane Z = 1: bright right of it, dark left of it, an edge two pixels wide.
  Lens lens = phone();
  lens.p = {};
  const auto camera = undistorted_camera(lens);
  ASSERT_TRUE(camera);
  scene::Image photo(lens.width, lens.height, 1);
  for (int y = 0; y < lens.height; ++y) {
    for (int x = 0; x < lens.width; ++x) {
      DVec2 plane((x + 0.5 - lens.cx) / lens.fx, (y + 0.5 - lens.cy) / lens.fy);
      const DVec2 goal(x + 0.5, y + 0.5);
      for (int i = 0; i < 40; ++i) {  // fixed point: the lens is nearly the identity
        const DVec2 error = goal - photo_from_plane(lens, plane);
        plane += DVec2(error.x / lens.fx, error.y / lens.fy);
      }
      photo.at(x, y) = float(std::clamp(0.5 + 0.5 * (plane.x - 0.22) * lens.fx, 0.0, 1.0));
    }
  }
  const auto undistorted = undistort(photo, lens, *camera);
  ASSERT_TRUE(undistorted);
  const auto edge = [](const scene::Image& image, int y) {  // column where the row's brightness starts
    double bright = 0;
    for (int x = 0; x < image.width; ++x) bright += image.at(x, y);
    return image.width - bright;
  };
  const double expected = camera->fx * 0.22 + camera->cx;
  double bend = 0;
  for (int y = 2; y < lens.height - 2; ++y) {
    EXPECT_NEAR(edge(*undistorted, y), expected, 0.03) << "row " << y;
    bend = std::max(bend, std::abs(edge(photo, y) - expected));
  }
  EXPECT_GT(bend, 1.0);  // it was bent before
}

TEST(Undistort, RepeatsTheEdgeOfThePhotoAndSurvivesAnyCamera) {
  const Lens lens = phone();
  auto camera = undistorted_camera(lens);
  ASSERT_TRUE(camera);
  camera->fx = camera->fy = 1e-300;  // every ray but one misses the photo by more than a double can say
  const auto undistorted = undistort(coordinates(lens.width, lens.height), lens, *camera);
  ASSERT_TRUE(undistorted);
  for (const float value : undistorted->data) ASSERT_TRUE(value >= 0.5f && value <= 319.5f);
}

TEST(Undistort, RefusesAPhotoOfAnotherSize) {
  const auto camera = undistorted_camera(phone());
  EXPECT_EQ(undistort(scene::Image(319, 240, 3), phone(), *camera).error().code, ErrorCode::invalid_argument);
}

TEST(Resized, ScalesTheLensWithThePhoto) {
  const Lens half = resized(phone(), 160, 120);
  const DVec2 full_pixel = photo_from_plane(phone(), {0.2, 0.1}), half_pixel = photo_from_plane(half, {0.2, 0.1});
  EXPECT_NEAR(half_pixel.x, full_pixel.x / 2, 1e-12);
  EXPECT_NEAR(half_pixel.y, full_pixel.y / 2, 1e-12);
}

}  // namespace
}  // namespace engine::io
