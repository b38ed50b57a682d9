#include "engine/evaluate/round_trip.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "engine/correct/scene_corrector.h"
#include "engine/evaluate/cases.h"

namespace engine::evaluate {
namespace {

const Case& slide() {
  static const Case made = make_case("slide").value();
  return made;
}

edit::Request quick_request() {
  edit::Request request = slide().request;
  request.params.intervals = 1, request.params.views = 6, request.params.max_image_side = 120;
  request.params.interpolation = edit::Interpolation::rigid;
  return request;
}

TEST(RoundTrip, WhatIsOnlyDeformedComesBackAsItWas) {
  const auto trip = there_and_back(slide().before, slide().cameras, quick_request(), nullptr);
  ASSERT_TRUE(trip) << trip.error().message;
  EXPECT_GT(trip->arrived, 0.99);
  EXPECT_GT(trip->inside.pixels, 1000u);
  EXPECT_GT(trip->inside.psnr_db, 60);
  EXPECT_GT(trip->outside.psnr_db, 60);
  EXPECT_GE(trip->cameras.size(), 3u);
  EXPECT_GT(trip->seconds, 0);
  EXPECT_LT(judge(JudgedViews(slide()), trip->halfway).miss, 0.01) << "half-way it was elsewhere";
}

TEST(RoundTrip, WhatIsSelectedComesBackAsItWas) {
  edit::Request request = quick_request();
  request.params.interpolation = edit::Interpolation::arap;
  request.selected.emplace();
  const edit::Handle& handle = request.handles[0];
  for (std::uint32_t row = 0; row < slide().before.size(); ++row) {
    const DVec3 mean(slide().before.mean.get(row));
    const DVec3 off = glm::abs(mean - request.region->center) - request.region->size / 2.0;
    if (glm::distance(mean, handle.source) < handle.radius && std::max({off.x, off.y, off.z}) < 0)
      request.selected->push_back(row);
  }
  const auto trip = there_and_back(slide().before, slide().cameras, request, nullptr);
  ASSERT_TRUE(trip) << trip.error().message;
  EXPECT_GT(trip->arrived, 0.9);
  EXPECT_GT(trip->inside.psnr_db, 60);
}

TEST(RoundTrip, WhatIsRepairedHalfWayIsCoveredAgain) {
  edit::Request request = quick_request();
  request.params.iterations = 30;
  correct::SceneCorrector corrector;
  const auto trip = there_and_back(slide().before, slide().cameras, request, &corrector);
  ASSERT_TRUE(trip) << trip.error().message;
  EXPECT_GT(trip->arrived, 0.9);
  EXPECT_GT(trip->inside.psnr_db, 25);
  EXPECT_GT(trip->halfway.size(), slide().before.size()) << "seeds";
}

TEST(RoundTrip, ADragToNowhereLooksLikeTheInput) {
  edit::Request request = quick_request();
  request.params.iterations = 30;
  correct::SceneCorrector scene;
  for (correct::Corrector* corrector :
       {static_cast<correct::Corrector*>(nullptr), static_cast<correct::Corrector*>(&scene)}) {
    const auto still = zero_drag(slide().before, slide().cameras, request, corrector);
    ASSERT_TRUE(still) << still.error().message;
    EXPECT_GT(still->pixels, 500u);
    EXPECT_GT(still->psnr_db, 55);
  }
}

TEST(RoundTrip, ErrorsAreThoseOfTheEdit) {
  edit::Request request = quick_request();
  request.handles[0].source += DVec3(0, -100, 0);
  const auto trip = there_and_back(slide().before, slide().cameras, request, nullptr);
  ASSERT_FALSE(trip);
  EXPECT_EQ(trip.error().where, "handles[0].radius");
  EXPECT_FALSE(zero_drag(slide().before, slide().cameras, request, nullptr));
}

TEST(Between, IsHalfWay) {
  const auto a = scene::look_at(DVec3(1, 0, 0), DVec3(0), DVec3(0, -1, 0), 0.9, 64, 48);
  auto b = scene::look_at(DVec3(0, 0, 1), DVec3(0), DVec3(0, -1, 0), 0.9, 64, 48);
  b.fx *= 2;
  const scene::Camera half = between(a, b);
  EXPECT_LT(glm::distance(half.centre(), DVec3(0.5, 0, 0.5)), 1e-12);
  const DVec3 ahead = glm::transpose(half.rotation) * DVec3(0, 0, 1);
  EXPECT_LT(glm::distance(ahead, glm::normalize(DVec3(-1, 0, -1))), 1e-12);
  EXPECT_DOUBLE_EQ(half.fx, 1.5 * a.fx);
  EXPECT_EQ(half.width, a.width);
}

}  // namespace
}  // namespace engine::evaluate
