#include "engine/repair/seed.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "engine/render/forward.h"
#include "engine/scene/sh.h"
#include "tests/engine/edit/samples.h"

namespace engine::repair {
namespace {

using edit::ball_before_wall, edit::same_row;
using working::Role;

/// A tilted camera that looks down at the floor y = 0 from the side, by this angle about the vertical.
scene::Camera above_floor(int side, double angle_rad = 0) {
  const DVec3 eye(2 * std::sin(angle_rad), -1.5, -2 * std::cos(angle_rad));
  return scene::look_at(eye, DVec3(0), DVec3(0.5, -1, 0), 0.8, side, side);
}

/// Inverse depth of the floor at the pixels of a part of the picture, 0 elsewhere.
scene::Image floor_in(const scene::Camera& camera, scene::Rect part) {
  scene::Image out(camera.width, camera.height, 1);
  for (int y = part.y0; y < part.y1; ++y)
    for (int x = part.x0; x < part.x1; ++x) {
      const DVec3 eye = camera.centre(), ray = camera.ray_direction({x + 0.5, y + 0.5});
      out.at(x, y) = float(1 / camera.cam_from_world(eye - eye.y / ray.y * ray).z);
    }
  return out;
}

scene::Image smooth_picture(int side) {
  scene::Image picture(side, side, 3);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x)
        picture.at(x, y, c) = float(0.5 + 0.3 * std::sin(0.1 * (x + c * y)) * std::cos(0.07 * y));
  return picture;
}

/// A scene of some rows, and seeds in it.
struct Seeded {
  scene::GaussianCloud scene = ball_before_wall(40);
  scene::Camera camera;
  scene::Image inverse_depth, picture;
  WorkingScene working;
  std::size_t seeds = 0;

  Seeded(int side, scene::Rect part) : camera(above_floor(side)), picture(smooth_picture(side)) {
    inverse_depth = floor_in(camera, part);
    working = WorkingScene(scene, working::Frame(), working::HandleColumn(scene.size(), 0));
    std::vector<float> points;
    for (std::size_t row = 0; row < scene.size(); ++row)
      for (int axis = 0; axis < 3; ++axis) points.push_back(scene.mean.get(row)[axis]);
    seeds = add_seeds(working, camera, inverse_depth, picture, neighbours::PointIndex(points, 3));
  }
  /// The seeds alone.
  [[nodiscard]] scene::GaussianCloud alone() const {
    std::vector<std::uint8_t> keep(working.size(), 1);
    std::fill_n(keep.begin(), scene.size(), std::uint8_t(0));
    return scene::select(working.cloud(), keep);
  }
};

constexpr int side = 48;
constexpr scene::Rect part{14, 20, 34, 36};

TEST(PointAt, IsOnTheRayThroughThePixelAtThatDepth) {
  scene::Camera camera = above_floor(48, 0.4);
  camera.cx += 3, camera.fy *= 1.2;
  const DVec3 in_cam = camera.cam_from_world(point_at(camera, {10.25, 40.5}, 0.4));
  EXPECT_NEAR(in_cam.z, 2.5, 1e-12);
  EXPECT_NEAR(camera.pixel_from_cam(in_cam).x, 10.25, 1e-9);
  EXPECT_NEAR(camera.pixel_from_cam(in_cam).y, 40.5, 1e-9);
}

TEST(AddSeeds, LaysOnePerPixelOnTheSurfaceInThePicturesColour) {
  const Seeded seeded(side, part);
  const scene::GaussianCloud& cloud = seeded.working.cloud();
  ASSERT_EQ(seeded.seeds, std::size_t(part.width() * part.height()));
  ASSERT_EQ(cloud.size(), seeded.scene.size() + seeded.seeds);
  std::size_t row = seeded.scene.size();
  for (int y = part.y0; y < part.y1; ++y)
    for (int x = part.x0; x < part.x1; ++x, ++row) {
      EXPECT_NEAR(cloud.mean.y[row], 0, 1e-5) << x << ", " << y;
      const DVec2 pixel = seeded.camera.pixel_from_cam(seeded.camera.cam_from_world(DVec3(cloud.mean.get(row))));
      EXPECT_LT(glm::length(pixel - DVec2(x + 0.5, y + 0.5)), 1e-3);
      const auto sh = cloud.sh_row(row);
      for (std::size_t k = 0; k < sh.size(); ++k) {
        const std::size_t coefficients = scene::sh_coefficients(cloud.sh_degree);
        if (k % coefficients == 0) {
          EXPECT_NEAR(0.5 + scene::sh_c0 * double(sh[k]), seeded.picture.at(x, y, int(k / coefficients)), 1e-6);
        } else {
          EXPECT_EQ(sh[k], 0) << "the same from all sides";
        }
      }
    }
}

TEST(AddSeeds, LiesFlatOnTheSurface) {
  const Seeded seeded(side, part);
  const scene::GaussianCloud cloud = seeded.alone();
  for (std::size_t row = 0; row < cloud.size(); ++row) {
    const Quat rotation = cloud.rotation.get(row);
    EXPECT_NEAR(glm::length(rotation), 1, 1e-5);
    EXPECT_GT(std::abs((rotation * Vec3(0, 0, 1)).y), 0.9999f) << row << ": the third axis is the normal";
    const Vec3 log_scale = cloud.log_scale.get(row);
    EXPECT_LT(log_scale.z, std::min(log_scale.x, log_scale.y) - 1.5f) << row;
    EXPECT_LT(std::abs(log_scale.x - log_scale.y), 1.5f) << row << ": a pixel on a slant, no needle";
  }
}

TEST(AddSeeds, CoversTheSurfaceFromThereAndFromBeside) {
  const Seeded seeded(side, part);
  const scene::GaussianCloud cloud = seeded.alone();
  for (const double angle : {0.0, 0.35, -0.35}) {
    const scene::Camera camera = above_floor(side, angle);
    const render::Rendering shown = render::forward(cloud, camera);
    std::size_t looked_at = 0;
    for (int y = part.y0 + 2; y < part.y1 - 2; ++y)
      for (int x = part.x0 + 2; x < part.x1 - 2; ++x) {
        const DVec3 point = point_at(seeded.camera, {x + 0.5, y + 0.5}, double(seeded.inverse_depth.at(x, y)));
        const DVec2 pixel = camera.pixel_from_cam(camera.cam_from_world(point));
        const int u = int(pixel.x), v = int(pixel.y);
        ASSERT_GT(shown.alpha.at(u, v), 0.9f) << angle << ": " << x << ", " << y;
        for (int c = 0; c < 3; ++c)
          ASSERT_NEAR(shown.color.at(u, v, c), seeded.picture.at(x, y, c), 0.06f) << angle << ": " << x << ", " << y;
        ++looked_at;
      }
    EXPECT_GT(looked_at, 100u);
  }
  EXPECT_LT(render::forward(cloud, seeded.camera).alpha.at(5, 5), 0.01f) << "and nothing else";
}

TEST(AddSeeds, TakesWhatItCannotKnowFromTheNearestInputRow) {
  const Seeded seeded(side, part);
  const WorkingScene& working = seeded.working;
  EXPECT_TRUE(working.check());
  for (std::size_t row = seeded.scene.size(); row < working.size(); ++row) {
    EXPECT_EQ(working.role()[row], Role::seed);
    EXPECT_EQ(working.handle()[row], 0);
    EXPECT_EQ(working.mean_at_deform().get(row), working.cloud().mean.get(row));
    const auto distance = [&](std::size_t input) {
      return glm::distance(DVec3(seeded.scene.mean.get(input)), DVec3(working.cloud().mean.get(row)));
    };
    double nearest = 1e9;
    for (std::size_t input = 0; input < seeded.scene.size(); ++input) nearest = std::min(nearest, distance(input));
    ASSERT_LT(working.parent()[row], seeded.scene.size());
    EXPECT_NEAR(distance(working.parent()[row]), nearest, 1e-6);
    const auto extra = working.cloud().extra_row(row), of_parent = seeded.scene.extra_row(working.parent()[row]);
    EXPECT_EQ(std::memcmp(extra.data(), of_parent.data(), extra.size()), 0);
  }
  for (std::size_t row = 0; row < seeded.scene.size(); ++row) {
    EXPECT_TRUE(same_row(working.cloud(), row, seeded.scene, row)) << row;
    EXPECT_EQ(working.role()[row], Role::frozen);
  }
}

TEST(AddSeeds, OfNothingAddsNothing) {
  const Seeded seeded(side, {});
  EXPECT_EQ(seeded.seeds, 0u);
  EXPECT_EQ(seeded.working.cloud(), seeded.scene);
  EXPECT_EQ(seeded.working.size(), seeded.scene.size());
}

TEST(AddSeeds, ALonePixelFacesTheCamera) {
  const Seeded seeded(side, {20, 20, 21, 21});
  ASSERT_EQ(seeded.seeds, 1u);
  const scene::GaussianCloud cloud = seeded.alone();
  EXPECT_FALSE(scene::first_not_finite(cloud));
  const DVec3 normal(cloud.rotation.get(0) * Vec3(0, 0, 1));
  EXPECT_GT(std::abs((seeded.camera.rotation * normal).z), 0.999);
}

TEST(AddSeeds, AreNotMoreThanAnEditCanBear) {
  const Seeded seeded(200, {0, 0, 200, 200});
  EXPECT_LE(seeded.seeds, 20000u);
  EXPECT_GT(seeded.seeds, 5000u);
  // Fewer, but larger: they cover the surface all the same.
  const scene::Image alpha = render::forward(seeded.alone(), seeded.camera).alpha;
  for (int y = 4; y < 196; ++y)
    for (int x = 4; x < 196; ++x) ASSERT_GT(alpha.at(x, y), 0.9f) << x << ", " << y;
}

}  // namespace
}  // namespace engine::repair
