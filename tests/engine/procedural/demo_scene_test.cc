#include "engine/procedural/demo_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "engine/core/parallel.h"
#include "engine/procedural/materials.h"
#include "engine/procedural/objects.h"
#include "engine/procedural/surfels.h"

namespace engine::procedural {
namespace {

constexpr DemoOptions small{.gaussians = 2500, .views = 4, .width = 160, .height = 120};

/// The axis along which a Gaussian is thin: the surface normal.
Vec3 normal_of(const scene::GaussianCloud& cloud, std::size_t i) { return glm::mat3_cast(cloud.rotation.get(i))[2]; }

bool faces_a_camera(const DemoScene& demo, std::size_t i) {
  return std::any_of(demo.cameras.begin(), demo.cameras.end(), [&](const scene::Camera& camera) {
    return glm::dot(normal_of(demo.cloud, i), Vec3(camera.centre()) - demo.cloud.mean.get(i)) > 0;
  });
}

TEST(DemoScene, IsMadeOfFlatGaussiansThatFaceACamera) {
  const DemoScene demo = make_demo_scene(small);
  for (std::size_t i = 0; i < demo.cloud.size(); ++i) {
    const Vec3 s = demo.cloud.log_scale.get(i);
    ASSERT_LT(s.z, std::min(s.x, s.y) - 2) << "row " << i;
    ASSERT_GT(demo.cloud.opacity_logit[i], 3) << "row " << i;
    const std::string& object = demo.object_names[demo.object[i]];
    if (object == "plant" || object == "print") continue;  // thin sheets, seen from either side
    ASSERT_TRUE(faces_a_camera(demo, i)) << "row " << i << " of the " << object;
  }
}

TEST(DemoScene, HasNothingWhereNoCameraSees) {
  const DemoScene demo = make_demo_scene(small);
  for (std::size_t i = 0; i < demo.cloud.size(); ++i) {
    const Vec3 p = demo.cloud.mean.get(i);
    const std::string& object = demo.object_names[demo.object[i]];
    if (object == "table") {
      ASSERT_GT(std::hypot(p.x + 0.62f, p.z - 0.28f), 0.2f) << "under the pot: row " << i;
      ASSERT_FALSE(p.z > 1.04f && p.y > 0.02f) << "the edge towards the wall: row " << i;
    }
    if (object == "book") {
      ASSERT_LT(p.y, 0) << "the side a book lies on: row " << i;
    }
  }
}

TEST(DemoScene, WithItsBallCarriedElsewhereIsTheSameButForThatAndClosedAllOver) {
  const DemoScene demo = make_demo_scene(small);
  DemoOptions carried = small;
  carried.ball_shift = {0.75, 0, -0.125};
  const DemoScene after = make_demo_scene(carried);
  ASSERT_GT(after.cloud.size(), demo.cloud.size());
  const auto is_ball = [&](std::size_t i) { return after.object_names[after.object[i]] == "ball"; };
  float lit = 0, darkened = 0;
  for (std::size_t i = 0; i < demo.cloud.size(); ++i) {
    ASSERT_EQ(after.object[i], demo.object[i]);
    const DVec3 from(demo.cloud.mean.get(i)), to = is_ball(i) ? from + carried.ball_shift : from;
    ASSERT_EQ(after.cloud.mean.get(i), Vec3(to)) << i;
    if (is_ball(i)) {
      ASSERT_EQ(after.cloud.sh_row(i)[0], demo.cloud.sh_row(i)[0]) << "its light stays: row " << i;
    }
    if (after.object_names[after.object[i]] != "table") continue;
    const double was = std::hypot(from.x + 0.28, from.z + 0.62), is = std::hypot(from.x - 0.47, from.z + 0.745);
    // Beside the ball it is lighter than it was, or darker.
    if (was < 0.25 && is > 0.6) lit += after.cloud.sh_row(i)[0] - demo.cloud.sh_row(i)[0];
    if (is < 0.25 && was > 0.6) darkened += demo.cloud.sh_row(i)[0] - after.cloud.sh_row(i)[0];
  }
  EXPECT_GT(lit, 1) << "the shadow has left";
  EXPECT_GT(darkened, 1) << "and arrived";
  bool below_pot = false, below_ball = false;
  for (std::size_t i = demo.cloud.size(); i < after.cloud.size(); ++i) {
    const Vec3 p = after.cloud.mean.get(i);
    if (after.object_names[after.object[i]] == "table") below_pot |= std::hypot(p.x + 0.62f, p.z - 0.28f) < 0.2f;
    if (is_ball(i)) below_ball |= p.y > -0.05f && std::abs(p.x - 0.47f) < 0.2f;
  }
  EXPECT_TRUE(below_pot) << "the table, where the pot stands on it";
  EXPECT_TRUE(below_ball) << "the side that the ball lay on";
  const auto &there = demo.drags[0].handles[0], &back = after.drags[0].handles[0];
  EXPECT_EQ(back.source, there.source + carried.ball_shift) << "the drag takes hold of it where it is";
  EXPECT_EQ(back.target, there.source);
}

TEST(DemoScene, LooksDifferentFromEachSideOnGlazedThingsOnly) {
  const DemoScene demo = make_demo_scene(small);
  ASSERT_EQ(demo.cloud.sh_degree, 1);
  float ball = 0, room = 0;
  for (std::size_t i = 0; i < demo.cloud.size(); ++i) {
    const auto sh = demo.cloud.sh_row(i);
    const float strongest = std::max({std::abs(sh[1]), std::abs(sh[2]), std::abs(sh[3])});
    if (demo.object_names[demo.object[i]] == "ball") ball = std::max(ball, strongest);
    if (demo.object_names[demo.object[i]] == "room") room = std::max(room, strongest);
  }
  EXPECT_GT(ball, 0.05f);
  EXPECT_LT(room, 0.05f);
}

TEST(DemoScene, HasNamedCamerasThatLookAtTheTable) {
  const auto cameras = make_arc_cameras(40, 640, 480);
  ASSERT_EQ(cameras.size(), 40u);
  EXPECT_EQ(cameras[0].name, "view_00");
  EXPECT_EQ(cameras[39].name, "view_39");
  EXPECT_NEAR(cameras[0].centre().x, 0.05, 0.01) << "the first is in front";
  for (const scene::Camera& camera : cameras) {
    ASSERT_TRUE(scene::validate(camera));
    const DVec3 in_cam = camera.cam_from_world({0, -0.2, 0});
    const DVec2 pixel = camera.pixel_from_cam(in_cam);
    EXPECT_GT(in_cam.z, 1);
    EXPECT_NEAR(pixel.x, 320, 100);
    EXPECT_NEAR(pixel.y, 240, 150);
  }
}

TEST(DemoScene, SuggestsDragsThatCaptureWhatTheyName) {
  const DemoScene demo = make_demo_scene({.gaussians = 6'000, .views = 3});
  auto captured = [&](const SuggestedDrag& drag, std::size_t i) {
    return std::any_of(drag.handles.begin(), drag.handles.end(), [&](const SuggestedDrag::Handle& handle) {
      return glm::length(DVec3(demo.cloud.mean.get(i)) - handle.source) < handle.radius;
    });
  };
  ASSERT_EQ(demo.drags.size(), 2u);
  std::size_t ball = 0, ball_captured = 0, others = 0;
  for (std::size_t i = 0; i < demo.cloud.size(); ++i) {
    const bool is_ball = demo.object_names[demo.object[i]] == "ball", in = captured(demo.drags[0], i);
    ball += is_ball;
    ball_captured += is_ball && in;
    others += !is_ball && in;
  }
  EXPECT_EQ(demo.drags[0].name, "ball");
  EXPECT_GT(ball, 100u);
  EXPECT_EQ(ball_captured, ball);
  EXPECT_LT(others, ball / 20);

  std::size_t plant = 0;
  others = 0;
  for (std::size_t i = 0; i < demo.cloud.size(); ++i) {
    if (!captured(demo.drags[1], i)) continue;
    (demo.object_names[demo.object[i]] == "plant" ? plant : others) += 1;
  }
  EXPECT_EQ(demo.drags[1].name, "leaf");
  EXPECT_FALSE(demo.drags[1].handles[0].target) << "the stalk end is held";
  EXPECT_GT(plant, 50u);
  EXPECT_LT(others, plant / 20);
  for (const auto& handle : demo.drags[1].handles) {
    SuggestedDrag one{"", "", {handle}};
    std::size_t count = 0;
    for (std::size_t i = 0; i < demo.cloud.size(); ++i) count += captured(one, i);
    EXPECT_GT(count, 0u);
  }
}

TEST(DemoScene, NamesTheOptionThatIsOutOfRange) {
  EXPECT_TRUE(validate(DemoOptions{}));
  EXPECT_EQ(validate({.gaussians = 1999}).error().where, "gaussians");
  EXPECT_EQ(validate({.gaussians = 5'000'001}).error().where, "gaussians");
  EXPECT_EQ(validate({.views = 0}).error().where, "views");
  EXPECT_EQ(validate({.width = 0}).error().where, "width");
  EXPECT_EQ(validate({.height = 20000}).error().where, "height");
  for (const double wrong : {std::nan(""), std::numeric_limits<double>::infinity(), 1e300, -101.0})
    EXPECT_EQ(validate({.ball_shift = {0, wrong, 0}}).error().where, "ball-shift") << wrong;
  EXPECT_TRUE(validate({.ball_shift = {0, 0, -100}}));
}

TEST(Surfels, FollowAnObjectThatIsPutElsewhere) {
  Light light;
  const auto cameras = make_arc_cameras(3, 160, 120);
  auto middle_of = [&](Vec3 foot) {
    const std::vector<Object> objects{make_ball({foot, 0}, 0.2f, Vec3(0.8f), Vec3(0.1f))};
    const Surfels surfels = make_surfels(objects, light, cameras, 500, 0);
    EXPECT_NEAR(double(surfels.cloud.size()), 500, 5);
    const scene::Bounds box = scene::bounds(surfels.cloud);
    return 0.5f * (box.low + box.high);
  };
  const Vec3 moved = middle_of({0.5f, 0, 0.3f}) - middle_of({0, 0, 0});
  EXPECT_LT(glm::length(moved - Vec3(0.5f, 0, 0.3f)), 0.06f);
}

TEST(Surfels, AreTheSameForAnyNumberOfThreads) {
  const std::vector<Object> objects{make_table({}, {2, 1, 1}), make_mug({{0.3f, 0, 0}, 0.2f}),
                                    make_ball({{-0.3f, 0, 0}, 0}, 0.2f, Vec3(0.8f), Vec3(0.1f))};
  const auto cameras = make_arc_cameras(3, 160, 120);
  Surfels one, four;
  WorkArena(1).run([&] { one = make_surfels(objects, Light{}, cameras, 800, 3); });
  WorkArena(4).run([&] { four = make_surfels(objects, Light{}, cameras, 800, 3); });
  EXPECT_EQ(scene::first_not_finite(one.cloud), std::nullopt);
  EXPECT_TRUE(one.cloud == four.cloud);
  EXPECT_EQ(one.object, four.object);
}

TEST(Light, FallsThroughThePanesAndNotThroughTheBars) {
  Light light;  // the sun at the zenith, the default window of 3 x 2 panes of 1 x 1 with bars of 0.1
  EXPECT_NEAR(light.through_window({0, 0, 0.55f}), 1, 1e-6) << "middle pane";
  EXPECT_NEAR(light.through_window({0, 0, 0}), 0, 1e-6) << "the bar between the rows";
  EXPECT_NEAR(light.through_window({0.55f, 0, 0.55f}), 0, 1e-6) << "the bar between two columns";
  EXPECT_NEAR(light.through_window({1.1f, 5, -0.55f}), 1, 1e-6) << "far below";
  EXPECT_NEAR(light.through_window({3, 0, 0.5f}), 0, 1e-6) << "beside the window";
}

TEST(Surfels, AreNoneWhereNoCameraLooks) {
  const std::vector<Object> objects{make_ball({{0, 0, -50}, 0}, 0.2f, Vec3(0.8f), Vec3(0.1f))};
  EXPECT_EQ(make_surfels(objects, Light{}, make_arc_cameras(3, 160, 120), 500, 0).cloud.size(), 0u);
  EXPECT_EQ(make_surfels({}, Light{}, make_arc_cameras(3, 160, 120), 500, 0).cloud.size(), 0u);
}

}  // namespace
}  // namespace engine::procedural
