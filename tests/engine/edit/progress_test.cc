#include "engine/edit/progress.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

namespace engine::edit {
namespace {

using namespace std::chrono_literals;

Workload corrected_work() {
  Workload work;
  work.gaussians = 150'000, work.dragged = 4000, work.covered = 0.05;
  work.intervals = 3, work.corrections = 2, work.iterations = 150;
  work.corrected = true, work.kept = true;
  work.candidates = 40, work.views = 20, work.view_pixels = 200'000;
  work.frame = {3e-3, 1e-8};
  return work;
}

/// An edit that takes as long as its test says, step by step.
class ProgressTest : public testing::Test {
 protected:
  ProgressTest() {
    observer.progress = [this](const Progress& progress) { told.push_back(progress); };
  }

  ProgressMeter meter_of(const Workload& work) {
    return {observer, work, {}, [this] { return now; }};
  }
  void pass(double seconds) {
    now += std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(seconds));
  }
  [[nodiscard]] double left() const { return told.back().seconds_left.value(); }

  /// Carries out those stages of a plan that take place, each in ten steps, `slowness` times as long as planned.
  ///   returns  the seconds left that were told, over the true ones, at each step
  struct Told {
    double fraction = 0, ratio = 0;
  };
  std::vector<Told> carry_out(ProgressMeter& meter, const std::vector<PlannedStage>& plan,
                              const std::function<double(const PlannedStage&)>& slowness) {
    double all = 0;
    for (const PlannedStage& stage : plan) all += stage.seconds * slowness(stage);
    const auto begin = now;
    std::vector<Told> ratios;
    for (const PlannedStage& stage : plan) {
      if (slowness(stage) == 0) continue;  // the edit finds nothing to do there
      EXPECT_TRUE(meter.enter(stage.stage, stage.interval));
      for (int step = 1; step <= 10; ++step) {
        pass(stage.seconds * slowness(stage) / 10);
        EXPECT_TRUE(meter.advance(step / 10.0));
        const double gone = std::chrono::duration<double>(now - begin).count();
        if (gone < 0.99 * all) ratios.push_back({gone / all, left() / (all - gone)});
      }
    }
    meter.finish();
    return ratios;
  }

  std::chrono::steady_clock::time_point now{};
  std::vector<Progress> told;
  Observer observer;
};

TEST_F(ProgressTest, AnEditThatKeepsToItsPlanIsToldExactly) {
  const Workload work = corrected_work();
  ProgressMeter meter = meter_of(work);
  const auto plan = plan_of(work);
  for (const Told& at : carry_out(meter, plan, [](const PlannedStage&) { return 1; })) EXPECT_NEAR(at.ratio, 1, 1e-4);
  EXPECT_EQ(told.back().fraction, 1);
  EXPECT_EQ(left(), 0);
}

TEST_F(ProgressTest, BeginsWithTheEstimate) {
  const Workload work = corrected_work();
  ProgressMeter meter = meter_of(work);
  ASSERT_TRUE(meter.enter(Stage::assign, 0));
  EXPECT_NEAR(left(), seconds_of(plan_of(work)), 1e-9);
}

TEST_F(ProgressTest, SaysNothingOfTheTimeLeftUntilTheMachineWasMeasured) {
  Workload work = corrected_work();
  work.frame = {};
  ProgressMeter meter = meter_of(work);
  ASSERT_TRUE(meter.enter(Stage::assign, 0));
  EXPECT_EQ(told.back().seconds_left, std::nullopt);
  meter.refine(corrected_work());
  ASSERT_TRUE(meter.advance(1));
  EXPECT_GT(left(), 0);
}

TEST_F(ProgressTest, LearnsFromTheFirstTenthThatEverythingTakesLonger) {
  for (const double slowness : {0.5, 2.0}) {  // estimates are better than that (docs/estimates.md)
    SCOPED_TRACE(slowness);
    const Workload work = corrected_work();
    ProgressMeter meter = meter_of(work);
    for (const Told& at : carry_out(meter, plan_of(work), [&](const PlannedStage&) { return slowness; }))
      if (at.fraction > 0.1) {
        EXPECT_GT(at.ratio, 1 / 1.5) << at.fraction;
        EXPECT_LT(at.ratio, 1.5) << at.fraction;
      }
  }
}

TEST_F(ProgressTest, LearnsOfEachKindOfStageOnItsOwn) {
  const Workload work = corrected_work();
  ProgressMeter meter = meter_of(work);
  const auto slowness = [](const PlannedStage& stage) { return stage.stage == Stage::correct ? 5.0 : 1.0; };
  for (const Told& at : carry_out(meter, plan_of(work), slowness))
    if (at.fraction > 0.1 && at.fraction < 0.9) {
      EXPECT_LT(std::abs(std::log(at.ratio)), std::log(1.5)) << at.fraction;
    }
}

TEST_F(ProgressTest, TheTimeLeftStaysFiniteWhereAStageDoesNotGetOn) {
  const Workload work = corrected_work();
  ProgressMeter meter = meter_of(work);
  ASSERT_TRUE(meter.enter(Stage::assign, 0));
  ASSERT_TRUE(meter.enter(Stage::views, 0));
  double last = left();
  for (int i = 0; i < 5; ++i) {
    pass(1000);
    ASSERT_TRUE(meter.advance(0));
    EXPECT_TRUE(std::isfinite(left()));
    EXPECT_GE(left(), last);
    last = left();
  }
}

TEST_F(ProgressTest, StagesThatTakeNoTimeAtAllDoNoHarm) {
  Workload work;
  work.frame = {1e-9, 0};
  ProgressMeter meter = meter_of(work);
  carry_out(meter, plan_of(work), [](const PlannedStage&) { return 1; });
  for (const Progress& progress : told) {
    EXPECT_TRUE(std::isfinite(progress.fraction));
    EXPECT_TRUE(std::isfinite(progress.seconds_left.value()));
  }
}

TEST_F(ProgressTest, StagesThatArePassedOverAreDoneAndSayNothingOfTheirKind) {
  const Workload work = corrected_work();
  ProgressMeter meter = meter_of(work);
  const auto slowness = [](const PlannedStage& stage) {
    return stage.interval == 1 && (stage.stage == Stage::correct || stage.stage == Stage::observe) ? 0.0 : 1.0;
  };
  for (const Told& at : carry_out(meter, plan_of(work), slowness))
    if (at.fraction > 0.25) {
      EXPECT_NEAR(at.ratio, 1, 1e-4) << at.fraction;
    }
}

TEST_F(ProgressTest, AnEditThatGoesOnJumpsToItsIntervalAndIsToldWhatIsLeftFromThere) {
  Workload work = corrected_work();
  work.finished = 2;
  ProgressMeter meter = meter_of(work);
  meter.go_on_after(2);
  ASSERT_TRUE(meter.enter(Stage::assign, 2));
  std::vector<PlannedStage> rest = plan_of(work);
  std::erase_if(rest, [](const PlannedStage& stage) { return stage.interval < 3 && stage.stage != Stage::finish; });
  EXPECT_NEAR(left(), seconds_of(rest), 1e-9);
  EXPECT_GT(told.back().fraction, 0.4);
  for (const Told& at : carry_out(meter, rest, [](const PlannedStage&) { return 2; }))
    if (at.fraction > 0.1) {
      EXPECT_LT(std::abs(std::log(at.ratio)), std::log(1.5)) << at.fraction;
    }
}

TEST_F(ProgressTest, TheFractionNeverFallsWhenThePlanIsRefined) {
  const Workload work = corrected_work();
  Workload rough = work;
  rough.candidates = 400, rough.views = 1;
  ProgressMeter meter = meter_of(rough);
  ASSERT_TRUE(meter.enter(Stage::assign, 0));
  ASSERT_TRUE(meter.enter(Stage::views, 0));
  ASSERT_TRUE(meter.advance(0.9));
  meter.refine(work);
  carry_out(meter, plan_of(work), [](const PlannedStage&) { return 1; });
  for (std::size_t k = 1; k < told.size(); ++k) EXPECT_GE(told[k].fraction, told[k - 1].fraction);
  EXPECT_EQ(told.back().fraction, 1);
}

TEST_F(ProgressTest, TimesAreSummedByStageAndGoOnFromEarlierOnes) {
  ProgressMeter meter(observer, corrected_work(), {{Stage::mask, 5}}, [this] { return now; });
  for (const Stage stage : {Stage::mask, Stage::deform, Stage::mask}) {
    ASSERT_TRUE(meter.enter(stage, 1));
    pass(2);
  }
  meter.finish();
  ASSERT_EQ(meter.times().size(), 2u);
  EXPECT_EQ(meter.times()[0].stage, Stage::mask);
  EXPECT_DOUBLE_EQ(meter.times()[0].seconds, 9);
  EXPECT_DOUBLE_EQ(meter.times()[1].seconds, 2);
}

TEST_F(ProgressTest, AStopEndsTheEditAtTheNextStepAndTellsNothing) {
  std::stop_source source;
  observer.stop = source.get_token();
  ProgressMeter meter = meter_of(corrected_work());
  ASSERT_TRUE(meter.enter(Stage::assign, 0));
  source.request_stop();
  const auto stopped = meter.advance(0.5);
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().code, ErrorCode::cancelled);
  EXPECT_EQ(told.size(), 1u);
}

}  // namespace
}  // namespace engine::edit
