#include "engine/repair/closure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "engine/core/parallel.h"

namespace engine::repair {
namespace {

constexpr double half = 0.5;  // of a cube that stood on the floor z = 0 of the world, below z = 1
const Bounds cube{{-half, -half, 0}, {half, half, 1}};

/// A camera that looks at the middle of the cube's foot.
scene::Camera looking_from(DVec3 eye) {
  scene::Camera camera;
  camera.width = camera.height = 160;
  camera.fx = camera.fy = 200;
  camera.cx = camera.cy = 80;
  const DVec3 z = glm::normalize(-eye), x = glm::normalize(glm::cross(z, DVec3(0, 0, 1))), y = glm::cross(z, x);
  camera.rotation = glm::transpose(DMat3(x, y, z));
  camera.translation = -(camera.rotation * eye);
  return camera;
}

/// Distance along a ray to the nearest of the world's surfaces, in units of the ray; 0: none.
using World = std::function<double(DVec3 eye, DVec3 ray)>;

double to_floor(DVec3 eye, DVec3 ray) { return ray.z < 0 ? -eye.z / ray.z : 0; }
/// The floor ends at a wall, y = 0.5.
double to_corner(DVec3 eye, DVec3 ray) {
  const double floor = to_floor(eye, ray), wall = ray.y > 0 ? (half - eye.y) / ray.y : 0;
  return floor > 0 && (wall <= 0 || floor < wall) ? floor : std::max(wall, 0.0);
}
double to_nothing(DVec3, DVec3) { return 0; }

/// Distance to the cube, if the ray meets it; else 0.
double to_cube(DVec3 eye, DVec3 ray) {
  double begin = 0, end = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (cube.low[axis] - eye[axis]) / ray[axis], b = (cube.high[axis] - eye[axis]) / ray[axis];
    begin = std::max(begin, std::min(a, b)), end = std::min(end, std::max(a, b));
  }
  return begin < end ? begin : 0;
}

/// What a camera of the world with the cube tells: behind the cube nothing is known.
SpaceView told(const scene::Camera& camera, const World& world) {
  SpaceView view{camera, scene::Image(camera.width, camera.height, 1), scene::Image(camera.width, camera.height, 1),
                 scene::Image(camera.width, camera.height, 3), scene::Mask(camera.width, camera.height)};
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const DVec3 eye = camera.centre();
      const DVec3 ray =
          camera.world_from_cam({(x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy, 1}) - eye;
      const double behind = world(eye, ray), front = to_cube(eye, ray);
      view.before.at(x, y) = float(front > 0 ? front : behind);
      view.known.at(x, y) = float(front > 0 ? 0 : behind);
      view.left.at(x, y) = front > 0;
      const bool is_floor = std::abs((eye + behind * ray).z) < 1e-6;
      view.color.at(x, y, is_floor ? 0 : 1) = behind > 0 ? 0.8f : 0.0f;  // a red floor, a green wall
    }
  return view;
}

/// Cameras around the cube, above the floor, over this part of a turn around the side without the wall.
std::vector<SpaceView> around(const World& world, double turn = 1) {
  std::vector<SpaceView> views;
  for (int k = 0; k < 12; ++k) {
    const double angle = -1.5707963 + turn * 6.2831853 * (k / 11.0 - 0.5);
    views.push_back(told(looking_from({4 * std::cos(angle), 4 * std::sin(angle), 2 + 0.5 * (k % 3)}), world));
  }
  return views;
}

/// The point of the closure that a camera shows at a pixel.
std::optional<DVec3> closed_at(const Closure& closure, const scene::Camera& camera, DVec2 pixel, double from) {
  const double inverse_depth = closure.inverse_depth_at(camera, pixel, from);
  if (!(inverse_depth > 0)) return std::nullopt;
  const double z = 1 / inverse_depth;
  return camera.world_from_cam({(pixel.x - camera.cx) / camera.fx * z, (pixel.y - camera.cy) / camera.fy * z, z});
}

TEST(Closure, AFloorGoesOnUnderWhatStoodOnIt) {
  const auto views = around(to_floor);
  const Closure closure(cube, views);
  const scene::Camera above = looking_from({0.3, -0.2, 4});
  for (double x = -0.4; x < 0.45; x += 0.2)
    for (double y = -0.4; y < 0.45; y += 0.2) {
      const DVec3 foot(x, y, 0);
      const auto found = closed_at(closure, above, above.pixel_from_cam(above.cam_from_world(foot)), 2);
      ASSERT_TRUE(found) << x << ' ' << y;
      EXPECT_NEAR(found->z, 0, 0.05) << x << ' ' << y << ": two nodes of the grid, and no bulge";
      const Vec3 color = closure.color_at(*found);
      EXPECT_NEAR(color.x, 0.8f, 0.02f);
      EXPECT_NEAR(color.y, 0.0f, 0.02f);
    }
}

TEST(Closure, IsTheSameFromAllSides) {
  const Closure closure(cube, around(to_floor));
  const auto from_front = looking_from({0, -4, 2}), from_side = looking_from({4, 0, 3});
  const auto there = closed_at(closure, from_front, {80, 80}, 2.5);
  ASSERT_TRUE(there);
  const DVec3 seen = from_side.cam_from_world(*there);
  const auto again = closed_at(closure, from_side, from_side.pixel_from_cam(seen), 2.5);
  ASSERT_TRUE(again);
  EXPECT_LT(glm::distance(*there, *again), 0.02);
}

TEST(Closure, InACornerTheFloorMeetsTheWall) {
  const Closure closure(cube, around(to_corner, 0.4));
  const scene::Camera front = looking_from({0, -4, 2});
  const auto wall = closed_at(closure, front, front.pixel_from_cam(front.cam_from_world({0, 0.5, 0.7})), 2);
  ASSERT_TRUE(wall);
  EXPECT_NEAR(wall->y, 0.5, 0.1);
  EXPECT_GT(closure.color_at(*wall).y, closure.color_at(*wall).x) << "of the wall's colour";
  const auto floor = closed_at(closure, front, front.pixel_from_cam(front.cam_from_world({0, -0.3, 0})), 2);
  ASSERT_TRUE(floor);
  EXPECT_NEAR(floor->z, 0, 0.05);
  EXPECT_GT(closure.color_at(*floor).x, closure.color_at(*floor).y) << "of the floor's";
}

TEST(Closure, WhereNothingIsAroundNothingIsClosed) {
  const Closure closure(cube, around(to_nothing));
  const scene::Camera front = looking_from({0, -4, 2});
  EXPECT_FALSE(closed_at(closure, front, {80, 80}, 2));
}

TEST(Closure, LiesNowhereBeforeWhatHasLeftNorInSpaceThatWasSeen) {
  const Closure closure(cube, around(to_floor));
  const scene::Camera front = looking_from({0, -4, 1});
  for (int x = 60; x < 100; x += 4)
    for (int y = 60; y < 100; y += 4)
      if (const auto found = closed_at(closure, front, {x + 0.5, y + 0.5}, 0)) {
        EXPECT_LT(found->z, 0.05) << x << ' ' << y;
      }
}

TEST(Closure, WithoutExtentOrCamerasThereIsNone) {
  const scene::Camera front = looking_from({0, -4, 2});
  const Closure point({{1, 2, 3}, {1, 2, 3}}, around(to_floor)), blind(cube, {});
  EXPECT_EQ(point.inverse_depth_at(front, {80, 80}, 1), 0);
  EXPECT_EQ(point.color_at({0, 0, 0}), Vec3(0.0f));
  EXPECT_EQ(blind.inverse_depth_at(front, {80, 80}, 1), 0.0) << "0 everywhere, from the rim of the grid on";
  EXPECT_EQ(blind.color_at({0, 0, 0}), Vec3(0.0f));
}

TEST(Closure, HoldsFarFromTheOriginAndAtAnySize) {
  for (const double size : {1e-6, 1e6}) {
    const DVec3 away(3e4 * size, -2e4 * size, 1e4 * size);
    std::vector<SpaceView> views = around(to_floor);
    for (SpaceView& view : views) {
      for (scene::Image* depth : {&view.before, &view.known})
        for (float& value : depth->data) value = float(double(value) * size);
      view.camera.translation = size * view.camera.translation - view.camera.rotation * away;
    }
    const Closure closure({size * cube.low + away, size * cube.high + away}, views);
    scene::Camera above = looking_from({0.3, -0.2, 4});
    above.translation = size * above.translation - above.rotation * away;
    const auto found = closed_at(closure, above, {80, 80}, 2 * size);
    ASSERT_TRUE(found) << size;
    EXPECT_NEAR((found->z - away.z) / size, 0, 0.05) << size;
  }
}

TEST(Closure, TheSameForAnyNumberOfThreads) {
  const auto views = around(to_floor);
  const scene::Camera front = looking_from({0, -4, 2});
  const auto depths = [&] {
    const Closure closure(cube, views);
    std::vector<double> out;
    for (int x = 60; x < 100; ++x) out.push_back(closure.inverse_depth_at(front, {x + 0.5, 85.5}, 2));
    return out;
  };
  std::vector<double> alone, together;
  WorkArena(1).run([&] { alone = depths(); });
  WorkArena(4).run([&] { together = depths(); });
  EXPECT_EQ(alone, together);
}

}  // namespace
}  // namespace engine::repair
