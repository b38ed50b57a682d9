#include "engine/captures/backdrop.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "engine/captures/captured_case.h"
#include "engine/captures/photographs.h"
#include "engine/scene/sh.h"

namespace engine::captures {
namespace {

/// A grey wall of flat Gaussians at z = 3, upright and wide, before cameras around the origin that look along z.
Backdrop wall() {
  Backdrop out{.name = "wall", .photos = {}, .points = {}, .scene = {}};
  constexpr int side = 60;
  constexpr float spacing = 0.1f;
  out.scene.sh_degree = 3;
  out.scene.resize(side * side);
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u) {
      const auto row = std::size_t(v * side + u);
      out.scene.mean.set(row, {spacing * (float(u) - 29.5f), spacing * (float(v) - 29.5f), 3});
      out.scene.log_scale.set(row, {std::log(0.6f * spacing), std::log(0.6f * spacing), std::log(0.05f * spacing)});
      out.scene.rotation.set(row, {1, 0, 0, 0});
      out.scene.opacity_logit[row] = 5;
      out.points.push_back({DVec3(out.scene.mean.get(row)), {128, 128, 128}});
    }
  for (int i = 0; i < 9; ++i) {
    scene::Camera camera = scene::look_at({0.2 * (i - 4), 0, 0}, {0, 0, 3}, {0, -1, 0}, 0.9, 120, 90);
    camera.name = "photo_" + std::to_string(i);
    out.photos.push_back(fit::to_photo(camera, photograph(out.scene, camera)));
  }
  return out;
}

Plan plan_of(const std::string& name) { return std::ranges::find(known_plans(), name, &NamedPlan::name)->make(); }

const Stand in_the_middle{.view = "photo_4", .at = {0.5, 0.5}, .to = {0.7, 0.5}, .size = 0.3};

TEST(StandIn, PutsAThingUprightOnWhatThePhotoShows) {
  const Backdrop backdrop = wall();
  const Standing standing = stand_in(plan_of("can"), backdrop, in_the_middle).value();
  ASSERT_EQ(standing.plan.things.size(), 1u);
  const Thing& can = standing.plan.things[0];
  const auto placed = [&](Vec3 local) { return can.pose(DVec3(can.object.placement.world(local))); };
  const DVec3 foot = placed({0, 0, 0}), top = placed({0, -0.4f, 0});
  EXPECT_LT(glm::distance(foot, DVec3(0, 0, 3)), 0.05);
  EXPECT_LT(glm::distance(glm::normalize(top - foot), DVec3(0, 0, -1)), 0.05) << "off the wall";
  // The longest side of a can is its height, 0.478, and 0.3 of what the photo shows of the wall is meant.
  EXPECT_NEAR(0.478 * standing.scale, 0.3 * 2 * 3 * std::tan(0.45), 0.02);
  const DVec3 shift = can.motion(foot) - foot;
  EXPECT_NEAR(shift.x, 0.2 * 120 * 3 / backdrop.photos[4].camera.fx, 0.05);
  EXPECT_NEAR(shift.y, 0, 0.02);
  EXPECT_TRUE(standing.plan.surroundings.empty() && !standing.plan.region);
}

TEST(StandIn, SaysWhatIsWrongWithAPlaceOrACase) {
  const Backdrop backdrop = wall();
  Stand stand = in_the_middle;
  stand.view = "photo_9";
  EXPECT_EQ(stand_in(plan_of("can"), backdrop, stand).error().where, "view");
  Backdrop empty = wall();
  empty.scene.resize(0);
  EXPECT_EQ(stand_in(plan_of("can"), empty, in_the_middle).error().where, "at");
  EXPECT_EQ(stand_in(plan_of("rod"), backdrop, in_the_middle).error().where, "case");
  const auto where = [&](const Stand& wrong) { return stand_in(plan_of("can"), backdrop, wrong).error().where; };
  stand = in_the_middle, stand.to = {0.51, 0.5};
  EXPECT_EQ(where(stand), "to") << "it is there";
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  stand = in_the_middle, stand.at.y = nan;
  EXPECT_EQ(where(stand), "at");
  for (const double size : {nan, 0.0, -1.0, std::numeric_limits<double>::infinity()}) {
    stand = in_the_middle, stand.size = size;
    EXPECT_EQ(where(stand), "size") << size;
  }
}

TEST(StandIn, TurnsAThingOnAFloorToTheCamera) {
  // The wall is a floor to cameras that look down at it, and upright ones would see it edge-on.
  Backdrop backdrop = wall();
  for (const double pitch : {0.3, 0.7, 1.2}) {
    scene::Camera& camera = backdrop.photos[4].camera;
    const DVec3 eye = DVec3(0, 0, 3) + 3.0 * DVec3(0, std::cos(pitch), -std::sin(pitch));
    camera = scene::look_at(eye, {0, 0, 3}, {0, 0, -1}, 0.9, 120, 90);
    camera.name = "photo_4";
    const Standing standing = stand_in(plan_of("can"), backdrop, in_the_middle).value();
    const Thing& can = standing.plan.things[0];
    const DVec3 foot = can.pose(DVec3(can.object.placement.world({0, 0, 0})));
    const DVec3 before_it = can.pose(DVec3(can.object.placement.world({0, 0, 0})) + DVec3(0, 0, -1));
    EXPECT_GT(glm::dot(glm::normalize(before_it - foot), DVec3(0, 1, 0)), 0.9) << pitch;
  }
}

TEST(DrawnInto, CoversThePhotoWhereTheThingIsInFront) {
  const Backdrop backdrop = wall();
  const fit::Photo& photo = backdrop.photos[4];
  scene::GaussianCloud scene = backdrop.scene;
  const auto add = [&](float z) {
    const auto row = std::uint32_t(scene.size());
    scene.resize(row + 1);
    scene.mean.set(row, {0, 0, z});
    scene.log_scale.set(row, Vec3(std::log(0.1f)));
    scene.rotation.set(row, {1, 0, 0, 0});
    scene.opacity_logit[row] = 12;
    scene.sh_row(row)[0] = 0.5f / float(scene::sh_c0);  // red
    for (std::size_t c = 1; c < 3; ++c) scene.sh_row(row)[c * scene::sh_coefficients(3)] = -0.5f / float(scene::sh_c0);
    return row;
  };
  const std::vector<std::uint32_t> in_front{add(2)};
  scene::Image before;
  fit::to_image(photo, before);
  const scene::Image drawn = drawn_into(photo, scene, in_front);
  EXPECT_GT(drawn.at(60, 45, 0), 0.9f);
  EXPECT_LT(drawn.at(60, 45, 1), 0.1f);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(drawn.at(10, 10, c), before.at(10, 10, c), 1e-3);
  const std::vector<std::uint32_t> behind{add(4)};
  EXPECT_NEAR(drawn_into(photo, scene, behind).at(60, 45, 1), before.at(60, 45, 1), 0.02);
}

TEST(PointsBeside, AreThoseThatTwoPhotosStillShow) {
  const Backdrop backdrop = wall();
  const auto made = make_drawn_case("can", std::make_shared<const Backdrop>(backdrop), in_the_middle);
  ASSERT_TRUE(made);
  const auto beside = points_beside(backdrop, made->cameras, made->before, made->part_before);
  const auto has = [&](DVec3 place) {
    return std::ranges::any_of(beside, [&](const auto& p) { return glm::distance(p.position, place) < 0.08; });
  };
  EXPECT_FALSE(has({0, 0, 3})) << "beneath the can";
  EXPECT_TRUE(has({1, 0.5, 3}));
  EXPECT_FALSE(has({2.9, 2.9, 3})) << "in no photo";
}

TEST(DrawnCase, IsJudgedByPhotosThatNoFitSees) {
  const auto backdrop = std::make_shared<const Backdrop>(wall());
  const CapturedCase made = make_drawn_case("can", backdrop, in_the_middle).value();
  EXPECT_EQ(made.name, "can_in_wall");
  EXPECT_EQ(made.cameras.front().name, "photo_4");
  ASSERT_EQ(made.held_out.size(), 2u);
  EXPECT_EQ(made.held_out[1].name, "photo_8");
  EXPECT_EQ(made.cameras.size(), 7u);
  EXPECT_EQ(made.part_before, made.part_after);
  EXPECT_GT(made.part_before.size(), 500u);
  EXPECT_TRUE(made.moving.holds(made.handles[0].source)) << "a person points at the thing";
  EXPECT_NEAR(made.handles[0].target->x - made.handles[0].source.x, 0.78, 0.1);

  Backdrop few = *backdrop;
  few.photos.resize(5);
  Stand of_the_first = in_the_middle;
  of_the_first.view = "photo_0";
  EXPECT_EQ(make_drawn_case("can", std::make_shared<const Backdrop>(few), of_the_first).error().where, "view")
      << "no photo is left to judge";
  EXPECT_TRUE(make_drawn_case("teddy", backdrop, in_the_middle)->is_test);

  const Capture before = capture(made, Side::before), after = capture(made, Side::after);
  EXPECT_EQ(before.photos.size(), 7u);
  EXPECT_NE(before.photos[0].rgb, after.photos[0].rgb);
  EXPECT_GT(before.points.size(), 100u);
  const scene::Image truth = true_photograph(made, Side::after, made.held_out[0]);
  scene::Image photo;
  fit::to_image(backdrop->photos[0], photo);
  std::size_t changed = 0;
  for (std::size_t i = 0; i < photo.pixels(); ++i) changed += std::abs(truth.data[i] - photo.data[i]) > 0.1f;
  EXPECT_GT(changed, 100u);
  EXPECT_LT(changed, photo.pixels() / 4);
}

}  // namespace
}  // namespace engine::captures
