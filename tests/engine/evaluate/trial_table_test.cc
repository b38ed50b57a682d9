#include <gtest/gtest.h>

#include <algorithm>

#include "engine/evaluate/trip_trial.h"

namespace engine::evaluate {
namespace {

Trial sample() {
  Trial trial;
  trial.name = "slide", trial.corrector = "scene";
  trial.result.edited = {36.361, 0.94021, 10};
  trial.result.vacated = {32.5, 0.8, 5};
  trial.result.arrived = {58, 1, 5};
  trial.result.outside = {38.049, 0.998, 90};
  trial.result.miss = 0.00018;
  trial.lpips = 0.12345;
  trial.corrected_views = {41.754, 7};
  trial.seconds = 1.26;
  return trial;
}

TEST(TrialTable, HasARowForATrial) {
  EXPECT_EQ(
      trial_table_row(sample()),
      "| slide | scene | 36.36 | 0.9402 | 32.50 | 0.8000 | 58.00 | 1.0000 | 38.05 | 0.9980 | 0.1235 | 0.0002 | 41.75 "
      "| 1.3 |\n");
}

TEST(TrialTable, ShowsNoAgreementWhereNoViewWasCorrected) {
  Trial trial = sample();
  trial.corrected_views.pixels = 0;
  EXPECT_NE(trial_table_row(trial).find(" | - | "), std::string::npos) << trial_table_row(trial);
}

TEST(TrialTable, ShowsNoLpipsWhereThereIsNoNetwork) {
  Trial trial = sample();
  trial.lpips.reset();
  EXPECT_NE(trial_table_row(trial).find("| 0.9980 | - | 0.0002 |"), std::string::npos) << trial_table_row(trial);
}

TEST(TrialTable, HasAColumnForEachFigure) {
  const auto columns = [](const std::string& line) { return std::count(line.begin(), line.end(), '|'); };
  const std::string head = trial_table_head();
  EXPECT_EQ(columns(head), 2 * columns(trial_table_row(sample())));
}

TEST(TripTrial, HasALineForPeople) {
  const TripTrial trial{.request = "",
                        .corrector = "none",
                        .arrived = 0.975,
                        .inside = {30.126, 0.9, 4},
                        .outside = {45, 1, 9},
                        .zero_drag = {50.5, 1, 4},
                        .cameras = 3,
                        .seconds = 2.04};
  EXPECT_EQ(summary(trial),
            "there and back, none: 97.50 % of the drag arrived; inside 30.13 dB, outside 45.00 dB; 2.0 s there; zero "
            "drag, inside 50.5 dB\n");
}

TEST(CorrectorNamed, KnowsThoseOfABenchmark) {
  EXPECT_TRUE(corrector_named("scene"));
  EXPECT_TRUE(corrector_named("harmonic"));
  EXPECT_FALSE(corrector_named("none"));
}

}  // namespace
}  // namespace engine::evaluate
