#include "engine/repair/surfaces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <mutex>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"

namespace engine::repair {
namespace {

constexpr int width = 72, height = 60;
constexpr scene::Rect hole{25, 20, 50, 42};
constexpr double far_behind = 0.05;

bool inside(scene::Rect rect, int x, int y) { return x >= rect.x0 && x < rect.x1 && y >= rect.y0 && y < rect.y1; }

/// Inverse depth of a tilted plane at a pixel.
double tilted(int x, int y) { return 0.3 + 0.002 * (x + 0.5) - 0.001 * (y + 0.5); }

/// A plane all over the picture, but for `gap`, where something far behind it is seen.
SurfaceView plane_with(scene::Rect gap, double seen_in_gap = far_behind) {
  SurfaceView view{scene::Image(width, height, 1), scene::Mask(width, height), scene::Mask(width, height),
                   scene::Mask(width, height), scene::Mask(width, height)};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const bool is_gap = inside(gap, x, y);
      view.inverse_depth.at(x, y) = float(is_gap ? seen_in_gap : tilted(x, y));
      view.shows_surface.at(x, y) = !is_gap;
      view.vacated.at(x, y) = is_gap;
    }
  return view;
}

bool nowhere_free(DVec2, double) { return false; }

scene::Image inverse_depth_of(const SurfaceView& view, const IsFree& is_free, std::uint64_t seed) {
  return continued_surfaces(view, is_free, seed).inverse_depth;
}

std::size_t count(const scene::Image& surface) {
  return std::size_t(std::count_if(surface.data.begin(), surface.data.end(), [](float value) { return value != 0; }));
}

/// The plane goes on in the whole hole, and nowhere else.
void expect_goes_on(const scene::Image& surface, double tolerance = 0.01) {
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      if (inside(hole, x, y)) {
        ASSERT_NEAR(surface.at(x, y), tilted(x, y), tolerance * tilted(x, y)) << x << ", " << y;
      } else {
        ASSERT_EQ(surface.at(x, y), 0) << x << ", " << y;
      }
}

TEST(ContinuedSurfaces, APlaneGoesOnAcrossAHole) {
  expect_goes_on(inverse_depth_of(plane_with(hole), nowhere_free, 1), 1e-4);
  expect_goes_on(inverse_depth_of(plane_with(hole, /*nothing is seen*/ 0), nowhere_free, 1), 1e-4);
}

TEST(ContinuedSurfaces, TheMainOneIsKnownAroundTheHole) {
  const ContinuedSurfaces surfaces = continued_surfaces(plane_with(hole), nowhere_free, 1);
  ASSERT_TRUE(surfaces.main);
  for (const auto& [x, y] : {std::pair{3, 5}, {30, 30}, {70, 50}})
    EXPECT_NEAR(surfaces.main({x + 0.5, y + 0.5}), tilted(x, y), 1e-4);
  EXPECT_LT(surfaces.known.x0, hole.x0);
  EXPECT_LT(surfaces.known.y0, hole.y0);
  EXPECT_GT(surfaces.known.x1, hole.x1);
  EXPECT_GT(surfaces.known.y1, hole.y1);
  EXPECT_FALSE(continued_surfaces(plane_with({36, 0, width, height}), nowhere_free, 1).main) << "nothing goes on";
}

TEST(ContinuedSurfaces, NoiseAndOtherThingsAroundDoNotMatter) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    SCOPED_TRACE(seed);
    SurfaceView view = plane_with(hole);
    Rng rng(seed);
    for (std::size_t i = 0; i < view.inverse_depth.data.size(); ++i)
      if (view.shows_surface.data[i] != 0) {
        float& value = view.inverse_depth.data[i];
        value = rng.below(10) < 3 ? rng.uniform(0.1f, 0.25f) : value * (1 + 0.002f * rng.normal());
      }
    expect_goes_on(inverse_depth_of(view, nowhere_free, seed));
  }
}

TEST(ContinuedSurfaces, StopsWhereSomebodyHasLookedThrough) {
  std::mutex asked;
  bool all_on_plane = true;
  const auto left_is_free = [&](DVec2 pixel, double inverse_depth) {
    const std::lock_guard lock(asked);
    const double expected = tilted(int(pixel.x), int(pixel.y));
    all_on_plane =
        all_on_plane && pixel.x - std::floor(pixel.x) == 0.5 && std::abs(inverse_depth - expected) < 0.01 * expected;
    return pixel.x < 40;
  };
  const scene::Image surface = inverse_depth_of(plane_with(hole), left_is_free, 1);
  EXPECT_TRUE(all_on_plane) << "it asks for the point at the middle of a pixel, on the plane";
  for (int y = hole.y0; y < hole.y1; ++y)
    for (int x = hole.x0; x < hole.x1; ++x) ASSERT_EQ(surface.at(x, y) != 0, x >= 40) << x << ", " << y;
}

TEST(ContinuedSurfaces, AThingThatCoversLittleOfThePictureGoesOnAsWell) {
  // A small table in a large room: a thirtieth of what is seen, and most of what is near the hole.
  constexpr int wide = 400, high = 300;
  const scene::Rect table{180, 130, 240, 190}, gap{200, 150, 220, 170};
  SurfaceView view{scene::Image(wide, high, 1), scene::Mask(wide, high), scene::Mask(wide, high),
                   scene::Mask(wide, high), scene::Mask(wide, high)};
  for (int y = 0; y < high; ++y)
    for (int x = 0; x < wide; ++x) {
      view.inverse_depth.at(x, y) = float(inside(table, x, y) && !inside(gap, x, y) ? tilted(x, y) : far_behind);
      view.shows_surface.at(x, y) = !inside(gap, x, y);
      view.vacated.at(x, y) = inside(gap, x, y);
    }
  const scene::Image surface = inverse_depth_of(view, nowhere_free, 1);
  EXPECT_EQ(count(surface), 400u);
  EXPECT_NEAR(surface.at(210, 160), tilted(210, 160), 0.01 * tilted(210, 160));
}

TEST(ContinuedSurfaces, ItDoesNotGoOnBeyondItsEnd) {
  // The surface is in one half only: what is missing beside it, or below it, is not amid it.
  EXPECT_EQ(count(inverse_depth_of(plane_with({36, 0, width, height}), nowhere_free, 1)), 0u);
  EXPECT_EQ(count(inverse_depth_of(plane_with({0, 40, width, height}), nowhere_free, 1)), 0u);
}

TEST(ContinuedSurfaces, WhatIsOpenToTheRimOfThePictureMayAsWellEndThere) {
  const scene::Image surface = inverse_depth_of(plane_with({50, 20, width, 42}), nowhere_free, 1);
  for (int y = 28; y < 34; ++y) EXPECT_EQ(surface.at(width - 1, y), 0) << "five directions of eight meet the plane";
}

TEST(ContinuedSurfaces, CrumbsAreNoSurface) {
  SurfaceView view = plane_with(hole);
  view.vacated = scene::Mask(width, height);
  const int x = (hole.x0 + hole.x1) / 2, y = (hole.y0 + hole.y1) / 2;
  for (int row = 0; row < 3; ++row) {
    EXPECT_EQ(count(inverse_depth_of(view, nowhere_free, 1)), 0u) << row << " pixels wide";
    for (int i = 0; i < 7; ++i) view.vacated.at(x + i - 3, y + row) = 1;
  }
  EXPECT_EQ(count(inverse_depth_of(view, nowhere_free, 1)), 21u);
}

TEST(ContinuedSurfaces, WhatIsSeenInFrontHidesIt) {
  EXPECT_EQ(count(inverse_depth_of(plane_with(hole, 0.8), nowhere_free, 1)), 0u);
}

TEST(ContinuedSurfaces, WhereItIsSeenItselfItOnlyReplacesWhatIsDoubtful) {
  SurfaceView view = plane_with(hole);
  for (int y = hole.y0; y < hole.y1; ++y)
    for (int x = hole.x0; x < hole.x1; ++x) view.inverse_depth.at(x, y) = float(tilted(x, y));
  EXPECT_EQ(count(inverse_depth_of(view, nowhere_free, 1)), 0u);
  view.doubtful = view.vacated;
  expect_goes_on(inverse_depth_of(view, nowhere_free, 1));
}

TEST(ContinuedSurfaces, WhatNobodySawWithinWhatLeftHidesNothing) {
  SurfaceView view = plane_with(hole, 0.8);
  view.doubtful = view.vacated;
  EXPECT_EQ(count(inverse_depth_of(view, nowhere_free, 1)), 0u);
  view.within = view.vacated;
  expect_goes_on(inverse_depth_of(view, nowhere_free, 1), 1e-4);
}

TEST(ContinuedSurfaces, WhatIsCurvedGoesOnCurved) {
  // The near side of a ball before a wall; a plane through the rim of the hole would be off by up to 4 %.
  const auto ball = [](int x, int y) {
    const double u = (x + 0.5 - width / 2.0) / 30, v = (y + 0.5 - height / 2.0) / 30;
    return u * u + v * v < 1 ? 1 / (3 - std::sqrt(1 - (u * u + v * v) * 0.7)) : 0.1;
  };
  SurfaceView view = plane_with(hole);
  Rng rng(5);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      if (!inside(hole, x, y)) view.inverse_depth.at(x, y) = float(ball(x, y) * (1 + 0.001 * rng.normal()));
  const scene::Image surface = inverse_depth_of(view, nowhere_free, 1);
  for (int y = hole.y0; y < hole.y1; ++y)
    for (int x = hole.x0; x < hole.x1; ++x)
      ASSERT_NEAR(surface.at(x, y), ball(x, y), 0.012 * ball(x, y)) << x << " " << y;
}

TEST(ContinuedSurfaces, OnlyWherePartsHaveLeft) {
  SurfaceView view = plane_with(hole);
  view.vacated = scene::Mask(width, height);
  EXPECT_EQ(count(inverse_depth_of(view, nowhere_free, 1)), 0u);
}

TEST(ContinuedSurfaces, OfTwoTheNearerGoesOnAndTheFartherWhereThatCannotBe) {
  // A near plane as a frame around the hole, within a far one; of which either has more pixels.
  const double far_plane = 0.2;
  for (const scene::Rect frame : {scene::Rect{15, 10, 60, 52}, scene::Rect{6, 5, 66, 55}}) {
    SurfaceView view = plane_with(hole);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        if (!inside(frame, x, y)) view.inverse_depth.at(x, y) = float(far_plane);
    expect_goes_on(inverse_depth_of(view, nowhere_free, 1));
    const auto near_is_free = [](DVec2, double inverse_depth) { return inverse_depth > 0.25; };
    const scene::Image surface = inverse_depth_of(view, near_is_free, 1);
    for (int y = hole.y0; y < hole.y1; ++y)
      for (int x = hole.x0; x < hole.x1; ++x) ASSERT_NEAR(surface.at(x, y), far_plane, 0.002) << x << ", " << y;
  }
}

TEST(ContinuedSurfaces, AFewPixelsAreNoSurface) {
  SurfaceView view = plane_with(hole);
  view.shows_surface = scene::Mask(width, height);
  EXPECT_EQ(count(inverse_depth_of(view, nowhere_free, 1)), 0u) << "none at all";
  for (int i = 0; i < 8; ++i) view.shows_surface.at(5 + 8 * i, 10) = view.shows_surface.at(5 + 8 * i, 50) = 1;
  EXPECT_EQ(count(inverse_depth_of(view, nowhere_free, 1)), 0u);
}

TEST(ContinuedSurfaces, GivesTheSameBytesForAnyNumberOfThreads) {
  SurfaceView view = plane_with(hole);
  Rng rng(3);
  for (float& value : view.inverse_depth.data) value *= 1 + 0.002f * rng.normal();
  const scene::Image first = inverse_depth_of(view, nowhere_free, 7);
  EXPECT_GT(count(first), 0u);
  for (const int threads : {1, 2, 4})
    WorkArena(threads).run([&] { EXPECT_EQ(inverse_depth_of(view, nowhere_free, 7), first) << threads; });
}

}  // namespace
}  // namespace engine::repair
