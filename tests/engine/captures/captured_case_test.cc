#include "engine/captures/captured_case.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "engine/captures/grasp.h"
#include "engine/core/parallel.h"
#include "engine/edit/request.h"
#include "engine/scene/base_color.h"

namespace engine::captures {
namespace {

const CapturedCase& made(const std::string& name) {
  static std::map<std::string, CapturedCase> all;
  const auto found = all.find(name);
  return found != all.end() ? found->second : all.emplace(name, make_captured_case(name).value()).first->second;
}

TEST(CapturedCases, AreAtLeastTenOfWhichSomeAreTheTestSet) {
  const std::set<std::string> names(captured_case_names().begin(), captured_case_names().end());
  EXPECT_GE(names.size(), 10u);
  EXPECT_EQ(names.size(), captured_case_names().size());
  EXPECT_EQ(std::ranges::count_if(captured_case_names(), [](const auto& name) { return made(name).is_test; }), 11);
}

TEST(CapturedCases, AnUnknownOneIsNamedWithThoseThereAre) {
  const auto none = make_captured_case("slide");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::not_found);
  EXPECT_NE(none.error().message.find("mug"), std::string::npos);
  EXPECT_EQ(choose_captured_cases({"mug", "no such case"}).error().code, ErrorCode::not_found);
  EXPECT_EQ(choose_captured_cases({}).value(), captured_case_names());
  EXPECT_EQ(choose_captured_cases({"turn", "mug"}).value(), (std::vector<std::string>{"turn", "mug"}));
}

TEST(CapturedCases, WithShadowsDifferByTheseAlone) {
  const CapturedCase &plain = made("can"), &shadowed = made("can_shadow");
  EXPECT_EQ(shadowed.before.mean, plain.before.mean);
  EXPECT_EQ(shadowed.after.mean, plain.after.mean);
  EXPECT_EQ(shadowed.part_before, plain.part_before);
  const DVec3 foot(-0.3, 0, -0.15), arrived = foot + DVec3(0.62, 0, -0.08);
  const auto darkest = [](const scene::GaussianCloud& in_shadow, const scene::GaussianCloud& out, DVec3 around) {
    double least = 1;
    for (std::size_t row = 0; row < out.size(); ++row) {
      const DVec3 mean(out.mean.get(row));
      if (glm::distance(mean, around) > 0.3 || std::abs(mean.y) > 0.01) continue;
      least = std::min(least, double(scene::base_color(in_shadow, row).y / scene::base_color(out, row).y));
    }
    return least;
  };
  EXPECT_LT(darkest(shadowed.before, plain.before, foot), 0.7);
  EXPECT_GT(darkest(shadowed.before, plain.before, arrived), darkest(shadowed.after, plain.after, arrived) + 0.1);
  EXPECT_LT(darkest(shadowed.after, plain.after, arrived), 0.7) << "it has gone along";
}

TEST(CapturedCases, AnotherTakeIsTheSameWishBySomebodyElse) {
  const CapturedCase &first = made("mug"), second = make_captured_case("mug", 2).value();
  EXPECT_EQ(make_captured_case("mug", first_take)->handles[0].target, first.handles[0].target);
  EXPECT_EQ(second.name, first.name);
  EXPECT_FALSE(first.is_test);
  EXPECT_TRUE(second.is_test) << "no constant is chosen on it";
  EXPECT_NE(second.handles[0].target, first.handles[0].target);
  EXPECT_LT(glm::distance(*second.handles[0].target, *first.handles[0].target), 0.1)
      << "it is meant to go to one place";
  EXPECT_NE(second.clicks.inside[0], first.clicks.inside[0]);
  EXPECT_NE(second.cameras[1].translation, first.cameras[1].translation);
  EXPECT_NE(capture(second, Side::before).photos[0].rgb, capture(first, Side::before).photos[0].rgb);
}

TEST(CapturedCases, AreTheSameForAnyThreads) {
  Result<CapturedCase> one, four;
  Capture photos_of_one, photos_of_four;
  WorkArena(1).run([&] { one = make_captured_case("mug"), photos_of_one = capture(*one, Side::after); });
  WorkArena(4).run([&] { four = make_captured_case("mug"), photos_of_four = capture(*four, Side::after); });
  EXPECT_EQ(one->before, four->before);
  EXPECT_EQ(one->after, four->after);
  ASSERT_EQ(photos_of_one.photos.size(), photos_of_four.photos.size());
  for (std::size_t p = 0; p < photos_of_one.photos.size(); ++p)
    EXPECT_EQ(photos_of_one.photos[p].rgb, photos_of_four.photos[p].rgb) << p;
  ASSERT_EQ(photos_of_one.points.size(), photos_of_four.points.size());
  for (std::size_t p = 0; p < photos_of_one.points.size(); ++p)
    EXPECT_EQ(photos_of_one.points[p].position, photos_of_four.points[p].position) << p;
  EXPECT_EQ(one->handles[0].target, four->handles[0].target);
}

TEST(CapturedCases, AreAskedForAsAPersonWould) {
  for (const std::string& name : captured_case_names()) {
    SCOPED_TRACE(name);
    const CapturedCase& the_case = made(name);
    EXPECT_GE(the_case.handles.size(), 1u);
    EXPECT_LE(the_case.handles.size(), 3u);
    EXPECT_LE(the_case.clicks.inside.size() + the_case.clicks.outside.size(), 6u);
    EXPECT_GE(the_case.clicks.inside.size(), 1u);
    for (const DVec3& click : the_case.clicks.inside) EXPECT_TRUE(the_case.moving.holds(click)) << click.x;
    for (const DVec3& click : the_case.clicks.outside) EXPECT_FALSE(the_case.moving.holds(click)) << click.x;
    for (const edit::Handle& handle : the_case.handles)  // an anchor may be on a hinge
      EXPECT_TRUE(!handle.target || the_case.moving.holds(handle.source)) << handle.source.x;
    edit::Request request;
    request.handles = the_case.handles, request.region = the_case.region, request.mode = the_case.mode;
    EXPECT_TRUE(edit::validate(request));
  }
}

/// Distance from a place to the nearest of these rows.
double distance_to(const scene::GaussianCloud& cloud, const std::vector<std::uint32_t>& rows, DVec3 place) {
  double nearest = 1e9;
  for (const std::uint32_t row : rows) nearest = std::min(nearest, glm::distance(DVec3(cloud.mean.get(row)), place));
  return nearest;
}

TEST(CapturedCases, HandlesLeadNearlyToWhereThingsGo) {
  for (const std::string& name : captured_case_names()) {
    SCOPED_TRACE(name);
    const CapturedCase& the_case = made(name);
    double off = 0;
    for (const edit::Handle& handle : the_case.handles) {
      if (!handle.target) continue;
      const double way = glm::distance(handle.source, *handle.target);
      EXPECT_GT(way, 0.04);
      off = std::max(off, distance_to(the_case.after, the_case.part_after, *handle.target) / way);
    }
    EXPECT_LT(off, 0.25) << "a twentieth of the way, and half of the distance between Gaussians";
  }
}

TEST(CapturedCases, WhatMovesIsElsewhereAfterwardsAndNothingElseIs) {
  for (const std::string& name : captured_case_names()) {
    SCOPED_TRACE(name);
    const CapturedCase& the_case = made(name);
    ASSERT_GT(the_case.part_before.size(), 500u);
    std::vector<bool> moves(the_case.before.size(), false);
    for (const std::uint32_t row : the_case.part_before) moves[row] = true;
    for (std::uint32_t row = 0; row < the_case.before.size(); ++row) {
      const float way = glm::distance(the_case.before.mean.get(row), the_case.after.mean.get(row));
      ASSERT_EQ(way >= 0.01f, moves[row]) << row;
      if (!moves[row]) continue;
      ASSERT_TRUE(the_case.moving.holds(DVec3(the_case.before.mean.get(row)))) << row;
    }
  }
}

TEST(CapturedCases, CamerasThatJudgeTookNoPhotoAndSomeStandBeyond) {
  for (const std::string& name : captured_case_names()) {
    SCOPED_TRACE(name);
    const CapturedCase& the_case = made(name);
    EXPECT_GE(the_case.cameras.size(), 20u);
    EXPECT_LE(the_case.cameras.size(), 40u);
    ASSERT_GE(the_case.beyond, 1u);
    ASSERT_GT(the_case.held_out.size(), the_case.beyond);
    for (std::size_t i = 0; i < the_case.held_out.size(); ++i) {
      const DVec3 centre = the_case.held_out[i].centre();
      double nearest = 1e9;
      for (const scene::Camera& camera : the_case.cameras)
        nearest = std::min(nearest, glm::distance(camera.centre(), centre));
      EXPECT_GT(nearest, 0.02) << i;
      const bool is_beyond = i + the_case.beyond >= the_case.held_out.size();
      EXPECT_EQ(is_beyond, the_case.held_out[i].name.starts_with("beyond_")) << i;
    }
  }
}

TEST(CapturedCases, TheSameThingSelectedBadlyHasTheSamePhotos) {
  const CapturedCase &careful = made("mug"), &careless = made("mug_careless");
  EXPECT_TRUE(careless.careless);
  EXPECT_FALSE(careful.careless);
  EXPECT_EQ(careful.before, careless.before);
  EXPECT_EQ(capture(careful, Side::before).photos[3].rgb, capture(careless, Side::before).photos[3].rgb);
  EXPECT_NE(capture(careful, Side::before).photos[3].rgb, capture(careful, Side::after).photos[3].rgb);
}

TEST(CapturedCases, BallsTakeMostOfTheTruePartUnlessTheyArePlacedCarelessly) {
  for (const std::string& name : captured_case_names()) {
    SCOPED_TRACE(name);
    const CapturedCase& the_case = made(name);
    const auto grasp = grasp_by_balls(the_case, the_case.before);
    ASSERT_TRUE(grasp) << grasp.error().message;
    const Match found = match(the_case.before, grasp->rows, the_case.moving, opacities_times_area(the_case.before));
    if (the_case.careless) {
      EXPECT_LT(found.recall, 0.55);
      EXPECT_GT(found.recall, 0.2);
    } else {
      EXPECT_GT(found.recall, 0.45) << "of the true scene, whose hidden undersides count: of a board, half";
    }
  }
}

}  // namespace
}  // namespace engine::captures
