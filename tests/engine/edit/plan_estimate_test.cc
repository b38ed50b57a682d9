// What a plan expects an edit to take: how it depends on the work. How good it is, only a benchmark can say
// (docs/estimates.md).
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "engine/edit/plan.h"
#include "engine/edit/workload.h"
#include "engine/procedural/demo_scene.h"

namespace engine::edit {
namespace {

Workload typical() {
  Workload work;
  work.gaussians = 150'000, work.dragged = 6000, work.covered = 0.05;
  work.intervals = 4, work.corrections = 1, work.iterations = 100;
  work.corrected = true, work.shown = true, work.pictured = 4, work.kept = true;
  work.candidates = 40, work.views = 40, work.view_pixels = 512 * 384;
  work.frame = {3e-3, 1e-8};
  return work;
}

double seconds(const Workload& work) { return seconds_of(plan_of(work)); }

TEST(PlanEstimate, GrowsWithEverythingThatCosts) {
  const std::vector<std::pair<std::string, std::function<void(Workload&)>>> growths = {
      {"gaussians", [](Workload& w) { w.gaussians *= 2; }},
      {"dragged", [](Workload& w) { w.dragged *= 2; }},
      {"covered", [](Workload& w) { w.covered *= 2; }},
      {"intervals", [](Workload& w) { ++w.intervals; }},
      {"corrections", [](Workload& w) { ++w.corrections; }},
      {"iterations", [](Workload& w) { w.iterations *= 2; }},
      {"candidates", [](Workload& w) { ++w.candidates; }},
      {"virtual views", [](Workload& w) { w.virtual_views = true; }},
      {"views", [](Workload& w) { ++w.views; }},
      {"outskirts", [](Workload& w) { w.selected = true; }},
      {"picture size", [](Workload& w) { w.view_pixels *= 2; }},
      {"pictures", [](Workload& w) { ++w.pictured; }},
      {"a slower machine", [](Workload& w) { w.frame.gaussians *= 2; }},
      {"a machine with slower pixels", [](Workload& w) { w.frame.pixel *= 2; }}};
  for (const auto& [what, grow] : growths) {
    Workload more = typical();
    grow(more);
    EXPECT_GT(seconds(more), seconds(typical())) << what;
  }
}

TEST(PlanEstimate, ShrinksWithEverythingThatIsLeftOut) {
  const std::vector<std::pair<std::string, std::function<void(Workload&)>>> savings = {
      {"corrector", [](Workload& w) { w.corrected = false; }},
      {"optimisation", [](Workload& w) { w.iterations = 0; }},
      {"pictures", [](Workload& w) { w.shown = false; }},
      {"checkpoints", [](Workload& w) { w.kept = false; }},
      {"places to fill", [](Workload& w) { w.vacates = false; }}};
  for (const auto& [what, save] : savings) {
    Workload less = typical();
    save(less);
    EXPECT_LT(seconds(less), seconds(typical())) << what;
    for (const PlannedStage& stage : plan_of(less)) EXPECT_GE(stage.seconds, 0) << what;
  }
}

TEST(PlanEstimate, WhatIsKnownLaterChangesHowLongStagesTakeNotWhichThereAre) {
  Workload rough = typical();
  rough.dragged = 0, rough.covered = 0, rough.views = 0, rough.candidates = 0, rough.view_pixels = 0, rough.frame = {};
  const auto before = plan_of(rough), after = plan_of(typical());
  ASSERT_EQ(before.size(), after.size());
  for (std::size_t k = 0; k < after.size(); ++k) {
    EXPECT_EQ(before[k].stage, after[k].stage);
    EXPECT_EQ(before[k].interval, after[k].interval);
  }
}

TEST(PlanEstimate, TheUneditedSceneIsLookedAtOnceByEachRun) {
  const auto observed_in = [](const Workload& work) {
    std::vector<int> intervals;
    for (const PlannedStage& stage : plan_of(work))
      if (stage.stage == Stage::observe) intervals.push_back(stage.interval);
    return intervals;
  };
  Workload work = typical();
  EXPECT_EQ(observed_in(work), std::vector<int>{1});
  work.finished = 2;
  EXPECT_EQ(observed_in(work), std::vector<int>{3}) << "an edit that goes on has to look again";
  work.finished = 4;
  EXPECT_TRUE(observed_in(work).empty());
}

TEST(PlanEstimate, WithoutMeasuredFramesStagesKeepTheirProportions) {
  Workload work = typical();
  work.frame = {};
  double last = 0;
  for (const PlannedStage& stage : plan_of(work)) last = std::max(last, stage.seconds);
  EXPECT_GT(last, 0);
  EXPECT_LT(last, seconds(work));
}

class WorkloadTest : public testing::Test {
 protected:
  procedural::DemoScene demo = procedural::make_demo_scene({.gaussians = 5000, .views = 5, .width = 64, .height = 48});
};

TEST_F(WorkloadTest, FramesTakeTimeAndMoreOfItTheMorePixelsThereAre) {
  const FrameTime frame = measured_frames(demo.cloud, demo.cameras, 64);
  EXPECT_GT(frame.of(64 * 48), 0);
  EXPECT_GE(frame.of(1'000'000), frame.of(64 * 48));
  EXPECT_EQ(measured_frames(demo.cloud, {}, 64).of(1000), 0);
}

TEST_F(WorkloadTest, ThePartsBoxCoversItsShareOfThePictures) {
  std::vector<std::uint32_t> all(demo.cloud.size()), ball;
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i] = std::uint32_t(i);
    if (demo.object_names[demo.object[i]] == "ball") ball.push_back(std::uint32_t(i));
  }
  const double of_ball = covered_part(demo.cloud, ball, demo.cameras);
  EXPECT_GT(of_ball, 0);
  EXPECT_LT(of_ball, 0.5);
  EXPECT_GT(covered_part(demo.cloud, all, demo.cameras), 0.9);
  EXPECT_EQ(covered_part(demo.cloud, {}, demo.cameras), 0);
  EXPECT_EQ(covered_part(demo.cloud, ball, {}), 0);
}

TEST_F(WorkloadTest, PixelsAreThoseOfTheWorkingPicture) {
  EXPECT_EQ(view_pixels(demo.cameras, 512), 64u * 48u);
  EXPECT_EQ(view_pixels(demo.cameras, 32), 32u * 24u);
  EXPECT_EQ(view_pixels({}, 32), 0u);
}

}  // namespace
}  // namespace engine::edit
