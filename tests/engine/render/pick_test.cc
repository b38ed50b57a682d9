#include "engine/render/pick.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "tests/engine/scene/random_overlay.h"

namespace engine::render {
namespace {

/// Opaque discs of radius 0.02, a hundredth apart, on the square |u|, |v| <= 1 of a plane.
scene::GaussianCloud sheet(DVec3 centre, DVec3 u, DVec3 v, float opacity_logit = 5) {
  constexpr int side = 201;
  const DVec3 normal = glm::normalize(glm::cross(u, v));
  const DQuat q = glm::quat_cast(DMat3(glm::normalize(u), glm::cross(normal, glm::normalize(u)), normal));
  scene::GaussianCloud cloud;
  cloud.resize(side * side);
  for (int i = 0; i < side * side; ++i) {
    const double s = 2.0 * (i % side) / (side - 1) - 1, t = 2.0 * (i / side) / (side - 1) - 1;
    cloud.mean.set(std::size_t(i), Vec3(centre + s * u + t * v));
    cloud.log_scale.set(std::size_t(i), {std::log(0.01f), std::log(0.01f), std::log(0.0005f)});
    cloud.rotation.set(std::size_t(i), Quat(q));
    cloud.opacity_logit[std::size_t(i)] = opacity_logit;
  }
  return cloud;
}

scene::GaussianCloud both(scene::GaussianCloud a, const scene::GaussianCloud& b) {
  std::vector<std::uint32_t> rows(b.size());
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = std::uint32_t(i);
  scene::append_rows(a, b, rows);
  return a;
}

scene::Camera camera_at(DVec3 eye, DVec3 target) { return scene::look_at(eye, target, DVec3(0, -1, 0), 0.9, 320, 240); }

std::optional<PixelHit> pick_at(const Layers& layers, const scene::Camera& camera, DVec2 pixel) {
  Workspace workspace;
  return pick(layers, camera, pixel, workspace);
}

double degrees_between(DVec3 a, DVec3 b) {
  return std::acos(std::clamp(glm::dot(a, b), -1.0, 1.0)) * 180 / std::numbers::pi;
}

TEST(Pick, FindsPointAndNormalOfATiltedSheet) {
  const DVec3 away(300, -200, 100);
  for (const DVec3 origin : {DVec3(0), away})
    for (const double tilt : {-60.0, -20.0, 0.0, 45.0, 70.0}) {
      SCOPED_TRACE(::testing::Message() << tilt << " degrees at " << origin.x);
      const double angle = tilt * std::numbers::pi / 180;
      const DVec3 u(std::cos(angle), 0, std::sin(angle)), v(0, 1, 0);
      const DVec3 normal = glm::normalize(glm::cross(v, u));
      const auto cloud = sheet(origin, u, v);
      const auto camera = camera_at(origin + DVec3(0.3, -0.2, -2), origin);
      for (const DVec2 pixel : {DVec2(160, 120), DVec2(150.25, 131.8), DVec2(170.9, 100.1)}) {
        const auto hit = pick_at(cloud, camera, pixel);
        ASSERT_TRUE(hit);
        // The point lies on the ray, at the depth, and on the sheet to within its discs.
        const DVec3 in_cam = camera.cam_from_world(hit->point);
        EXPECT_NEAR(in_cam.z, hit->depth, 1e-9);
        EXPECT_LT(glm::distance(camera.pixel_from_cam(in_cam), pixel), 1e-6);
        EXPECT_LT(std::abs(glm::dot(hit->point - origin, normal)), 0.02);
        EXPECT_NEAR(glm::length(hit->normal), 1, 1e-9);
        EXPECT_LT(glm::dot(hit->normal, camera.ray_direction(pixel)), 0);
        const DVec3 towards = glm::dot(normal, camera.ray_direction(pixel)) < 0 ? normal : -normal;
        EXPECT_LT(degrees_between(hit->normal, towards), 12);
        EXPECT_LT(glm::distance(DVec3(cloud.mean.get(hit->row)), hit->point), 0.03);
      }
    }
}

TEST(Pick, AgreesWithTheMedianDepthOfThePicture) {
  scene::GaussianCloud cloud;
  cloud.resize(400);
  Rng rng(5);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const float z = rng.uniform(1.0f, 6.0f);
    cloud.mean.set(i, {z * rng.uniform(-0.6f, 0.6f), z * rng.uniform(-0.5f, 0.5f), z});
    cloud.log_scale.set(i, {rng.uniform(-4.0f, -1.0f), rng.uniform(-4.0f, -1.0f), rng.uniform(-4.0f, -1.0f)});
    cloud.rotation.set(i, {rng.normal(), rng.normal(), rng.normal(), rng.normal()});
    cloud.opacity_logit[i] = rng.uniform(-3.0f, 4.0f);
  }
  const auto camera = scene::look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1.0, 60, 44);
  const auto picture = forward(cloud, camera, {.depth = true});
  Workspace workspace;
  int misses = 0, differing = 0;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const auto hit = pick(cloud, camera, DVec2(x + 0.5, y + 0.5), workspace);
      const float expected = picture.median_depth.at(x, y);
      misses += !hit;
      differing += float(hit ? hit->depth : 0) != expected;  // where rounding decides which splat crosses one half
      if (hit) {
        EXPECT_GE(picture.alpha.at(x, y), 0.5f - 1e-4f);
      } else {
        EXPECT_LE(picture.alpha.at(x, y), 0.5f + 1e-4f);
      }
    }
  EXPECT_LE(differing, 3);
  EXPECT_GT(misses, 20) << "or the scene tests nothing";
}

TEST(Pick, MissesWhatIsHalfTransparentAndWhatIsNotThere) {
  const auto camera = camera_at({0, 0, -2}, {0, 0, 0});
  const auto solid = sheet({0, 0, 0}, {0.3, 0, 0}, {0, 0.3, 0});
  EXPECT_TRUE(pick_at(solid, camera, {160, 120}));
  EXPECT_FALSE(pick_at(solid, camera, {10, 10}));
  for (const DVec2 outside : {DVec2(-1, 120), DVec2(160, -0.001), DVec2(320, 120), DVec2(160, 240), DVec2(1e300, 0)})
    EXPECT_FALSE(pick_at(solid, camera, outside));
  EXPECT_FALSE(pick_at(scene::GaussianCloud{}, camera, {160, 120}));
  scene::GaussianCloud dim;
  dim.resize(1);
  dim.log_scale.set(0, Vec3(std::log(0.3f)));
  dim.rotation.set(0, {1, 0, 0, 0});
  dim.opacity_logit[0] = std::log(0.49f / 0.51f);
  EXPECT_FALSE(pick_at(dim, camera, {160, 120}));
  dim.opacity_logit[0] = std::log(0.51f / 0.49f);
  EXPECT_TRUE(pick_at(dim, camera, {160, 120}));
}

TEST(Pick, SeesThroughHazeToTheSurface) {
  const auto haze = sheet({0, 0, -0.5}, {0.5, 0, 0}, {0, 0.5, 0}, -6);
  const auto wall = sheet({0, 0, 0}, {0.5, 0, 0}, {0, 0.5, 0});
  const auto hit = pick_at(both(haze, wall), camera_at({0, 0, -2}, {0, 0, 0}), {160.3, 119.7});
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->depth, 2, 1e-3);
  EXPECT_GE(hit->row, haze.size());
}

TEST(Pick, AtASilhouetteTheNormalIsTheDiscsOwn) {
  // A strip two pixels wide, tilted, far in front of a wall: most of the pixels around show the wall.
  const auto discs = sheet({0, 0, -1}, {0.1, 0, 0.1}, {0, 0.3, 0});
  std::vector<std::uint8_t> middle(discs.size());
  for (std::size_t i = 0; i < discs.size(); ++i) middle[i] = discs.mean.x[i] == 0;
  const auto strip = scene::select(discs, middle);
  auto wall = sheet({0, 0, 3}, {3, 0, 0}, {0, 3, 0});
  for (std::size_t i = 0; i < wall.size(); ++i) wall.log_scale.set(i, {std::log(0.03f), std::log(0.03f), -8});
  const auto camera = scene::look_at({0, 0, -2}, {0, 0, 0}, {0, -1, 0}, 0.9, 80, 60);
  const auto hit = pick_at(both(strip, wall), camera, {40, 30});
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->depth, 1, 1e-3);
  const DVec3 normal = glm::normalize(DVec3(1, 0, -1));
  EXPECT_LT(degrees_between(hit->normal, normal), 0.1) << hit->normal.x << " " << hit->normal.y << " " << hit->normal.z;
}

TEST(Pick, NumbersRowsAsTheMergedCloudDoes) {
  const auto base = std::make_shared<scene::GaussianCloud>(sheet({0, 0, 0}, {1, 0, 0}, {0, 1, 0}));
  auto overlay =
      std::make_shared<scene::Overlay>(scene::random_overlay(base->size(), 500, 3, [&](std::size_t n, std::uint64_t) {
        scene::GaussianCloud rows = scene::no_change(*base).rows;
        std::vector<std::uint32_t> some(n);
        for (std::size_t i = 0; i < n; ++i) some[i] = std::uint32_t(i);
        scene::append_rows(rows, *base, some);
        for (std::size_t i = 0; i < n; ++i) rows.mean.z[i] = 0.001f * float(i) / float(n);
        return rows;
      }));
  const DrawnVersion drawn({base, overlay});
  const scene::GaussianCloud merged = scene::flatten(drawn.version());
  const auto camera = camera_at({0.1, 0.2, -1.5}, {0, 0, 0});
  for (int i = 0; i < 40; ++i) {
    const DVec2 pixel(40 + 6.1 * i, 30 + 4.7 * i);
    const auto layered = pick_at(drawn.layers(), camera, pixel), flat = pick_at(merged, camera, pixel);
    ASSERT_EQ(layered.has_value(), flat.has_value());
    if (!flat) continue;
    EXPECT_EQ(layered->row, flat->row);
    EXPECT_EQ(layered->depth, flat->depth);
    EXPECT_EQ(layered->point, flat->point);
    EXPECT_EQ(layered->normal, flat->normal);
  }
}

TEST(Pick, SharesAWorkspaceWithPictures) {
  const auto cloud = sheet({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  const auto camera = camera_at({0, 0, -2}, {0, 0, 0});
  Workspace workspace;
  Rendering before, after;
  forward(cloud, camera, {}, {}, workspace, before);
  const auto hit = pick(cloud, camera, {100, 100}, workspace);
  forward(cloud, camera, {}, {}, workspace, after);
  EXPECT_TRUE(before.color == after.color);
  EXPECT_EQ(hit->row, pick_at(cloud, camera, {100, 100})->row);
}

}  // namespace
}  // namespace engine::render
