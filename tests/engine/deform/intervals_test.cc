#include "engine/deform/intervals.h"

#include <gtest/gtest.h>

#include <vector>

namespace engine::deform {
namespace {

int intervals(std::vector<DragLength> drags) { return default_intervals(drags); }

TEST(DefaultIntervals, IsTheLongestDragInRadiiRoundedUp) {
  EXPECT_EQ(intervals({{0.5, 0.3}, {0.1, 0.02}}), 5);
  EXPECT_EQ(intervals({{0.31, 0.3}}), 2);
  EXPECT_EQ(intervals({{0.29, 0.3}}), 1);
}

TEST(DefaultIntervals, StaysBetweenOneAndTwenty) {
  EXPECT_EQ(intervals({{0.0, 0.3}}), 1);
  EXPECT_EQ(intervals({}), 1);
  EXPECT_EQ(intervals({{100.0, 0.3}}), 20);
  EXPECT_EQ(intervals({{1e300, 1e-300}}), 20);  // the quotient overflows
}

TEST(DefaultIntervals, ForgivesRoundingOfAWholeNumberOfRadii) {
  EXPECT_GT((0.1 + 0.2) / 0.1, 3.0);
  EXPECT_EQ(intervals({{0.1 + 0.2, 0.1}}), 3);
}

TEST(IntervalTarget, WalksStraightAndEndsExactlyOnTheTarget) {
  const DVec3 source(0.1, -7.3, 1e6), target(0.7, 0.2, -1e6 / 3);
  EXPECT_EQ(interval_target(source, target, 7, 7), target);
  const DVec3 halfway = interval_target(source, target, 2, 4);
  EXPECT_NEAR(glm::distance(halfway, (source + target) / 2.0), 0, 1e-9);
}

}  // namespace
}  // namespace engine::deform
