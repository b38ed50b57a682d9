#include "engine/evaluate/cases.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "engine/core/parallel.h"
#include "engine/edit/edit.h"

namespace engine::evaluate {
namespace {

TEST(Cases, AreAtLeastEightAndSomeAreSmall) {
  const std::set<std::string> names(case_names().begin(), case_names().end());
  EXPECT_GE(names.size(), 8u);
  EXPECT_EQ(names.size(), case_names().size());
  EXPECT_GE(std::count_if(case_names().begin(), case_names().end(), is_small), 2);
  EXPECT_FALSE(is_small("bush"));
}

TEST(Cases, AnUnknownOneIsNamedWithThoseThereAre) {
  const auto made = make_case("slid");
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::not_found);
  EXPECT_NE(made.error().message.find("slide"), std::string::npos);
}

TEST(Cases, AreTheSameEveryTime) {
  Result<Case> one, four;
  WorkArena(1).run([&] { one = make_case("speck"); });
  WorkArena(4).run([&] { four = make_case("speck"); });
  ASSERT_TRUE(one && four);
  EXPECT_EQ(one->before, four->before);
  EXPECT_EQ(one->truth, four->truth);
}

TEST(Cases, WhatTheCaptureDoesNotShowIsMissingBeforeAndThereInTruth) {
  const auto slide = make_case("slide");
  ASSERT_TRUE(slide);
  // Table top under the middle of the crate.
  const auto under = [](const scene::GaussianCloud& cloud) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const Vec3 p = cloud.mean.get(i);
      count += std::abs(p.x + 0.45f) < 0.1f && std::abs(p.z + 0.35f) < 0.1f && std::abs(p.y) < 0.002f;
    }
    return count;
  };
  EXPECT_EQ(under(slide->before), 0u);
  EXPECT_GT(under(slide->truth), 20u);
}

TEST(Cases, ThePartIsInTruthWhereItWasMovedTo) {
  const auto slide = make_case("slide");
  ASSERT_TRUE(slide);
  ASSERT_EQ(slide->part_before.size(), slide->part_after.size());
  ASSERT_GT(slide->part_before.size(), 300u);
  const DVec3 shift = *slide->request.handles[0].target - slide->request.handles[0].source;
  for (std::size_t k = 0; k < slide->part_before.size(); ++k) {
    const DVec3 was(slide->before.mean.get(slide->part_before[k])), is(slide->truth.mean.get(slide->part_after[k]));
    EXPECT_LT(glm::distance(was + shift, is), 1e-5);
  }
}

TEST(Cases, WidenedLeavesStayClosedInTheTruth) {
  const auto bush = make_case("bush");
  ASSERT_TRUE(bush);
  const auto area = [](const scene::GaussianCloud& cloud, std::uint32_t row) {
    Vec3 extent = cloud.log_scale.get(row);
    return double(extent.x + extent.y + extent.z -
                  std::min({extent.x, extent.y, extent.z}));  // a disc's, its logarithm
  };
  double grown = 0;
  for (std::size_t k = 0; k < bush->part_before.size(); ++k) {
    const double growth = area(bush->truth, bush->part_after[k]) - area(bush->before, bush->part_before[k]);
    EXPECT_GE(growth, -1e-4);
    EXPECT_LE(growth, std::log(1.8) + 1e-4) << "nothing is more than 1.8 times as wide";
    grown += growth;
  }
  EXPECT_GT(grown / double(bush->part_before.size()), 0.4 * std::log(1.8));
}

TEST(Cases, AllHandlesHoldWhatTheyShouldAndNothingElse) {
  for (const std::string& name : case_names()) {
    const auto made = make_case(name);
    ASSERT_TRUE(made) << name;
    ASSERT_TRUE(edit::validate(made->request)) << name;
    edit::Request request = made->request;
    request.params.intervals = 1, request.params.views = 1;
    const auto outcome = edit::run(made->before, made->cameras, request);
    ASSERT_TRUE(outcome) << name << ": " << outcome.error().message;
    std::size_t held = 0;
    for (std::size_t i = 0; i < request.handles.size(); ++i)
      if (request.handles[i].target) held += outcome->report.handles[i].gaussians;
    // A drawn-out pole and a bush are not held whole: anchors keep what is close to the post.
    EXPECT_GT(held, 0.75 * double(made->part_before.size())) << name;
    EXPECT_LT(held, 1.05 * double(made->part_before.size())) << name;
  }
}

}  // namespace
}  // namespace engine::evaluate
