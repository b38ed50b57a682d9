#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/views/views.h"

namespace engine::views {
namespace {

/// A view on a circle around the handles, at an angle in degrees.
Candidate view(double degrees, double source_area, double target_area) {
  const double a = degrees * 0.017453292519943295;
  return {"view_" + std::to_string(int(degrees)), source_area, target_area, {std::cos(a), 0, std::sin(a)}};
}

using Indices = std::vector<std::size_t>;

TEST(ChooseViews, TakesTheViewThatSeesMostOfBothEndsFirst) {
  const std::vector<Candidate> views{view(0, 0.5, 0.0), view(90, 0.0, 0.6), view(180, 0.2, 0.2), view(270, 0.1, 0.1)};
  EXPECT_EQ(choose_views(views, 1), (Indices{2}));
}

TEST(ChooseViews, NeverTakesAViewThatSeesNothing) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Candidate> views{view(0, 0, 0), view(90, 0.1, 0), view(180, -1, -1), view(270, nan, nan)};
  EXPECT_EQ(choose_views(views, 4), (Indices{1}));
}

TEST(ChooseViews, SpreadsOverTheAngles) {
  std::vector<Candidate> views;
  for (int degrees = 0; degrees < 360; degrees += 10) views.push_back(view(degrees, 0.2, 0.2));
  Indices chosen = choose_views(views, 4);
  std::sort(chosen.begin(), chosen.end());
  EXPECT_EQ(chosen, (Indices{0, 9, 18, 27}));
}

TEST(ChooseViews, PrefersABetterViewFromElsewhereToATwin) {
  const std::vector<Candidate> views{view(0, 0.50, 0.50), view(1, 0.49, 0.49), view(120, 0.1, 0.1)};
  EXPECT_EQ(choose_views(views, 2), (Indices{0, 2}));
  EXPECT_EQ(choose_views(views, 3), (Indices{0, 2, 1}));
}

TEST(ChooseViews, BreaksTiesByTheLowerIndex) {
  const std::vector<Candidate> views{view(0, 0.1, 0.1), view(0, 0.1, 0.1), view(0, 0.1, 0.1)};
  EXPECT_EQ(choose_views(views, 3), (Indices{0, 1, 2}));
}

TEST(ChooseViews, LeavesOutExcludedNames) {
  const std::vector<Candidate> views{view(0, 0.5, 0.5), view(90, 0.1, 0.1), view(180, 0.4, 0.4)};
  const std::vector<std::string> excluded{"view_0", "nowhere"};
  EXPECT_EQ(choose_views(views, 3, excluded), (Indices{2, 1}));
}

TEST(ChooseViews, ReturnsAtMostCountAndNothingForZero) {
  const std::vector<Candidate> views{view(0, 0.5, 0.5), view(90, 0.1, 0.1)};
  EXPECT_EQ(choose_views(views, 1).size(), 1u);
  EXPECT_TRUE(choose_views(views, 0).empty());
  EXPECT_TRUE(choose_views(views, -3).empty());
  EXPECT_TRUE(choose_views({}, 5).empty());
}

}  // namespace
}  // namespace engine::views
