#include "engine/repair/thin_plate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "engine/core/parallel.h"

namespace engine::repair {
namespace {

/// A function on a grid, and what is known of it.
struct Sampled {
  GridSize size{};
  std::vector<Knowledge> known;
  std::vector<float> values;
};

/// Known where `is_known` says so; elsewhere there is nothing, and 7.
Sampled sampled(const GridSize& size, const std::function<double(int, int, int)>& of,
                const std::function<bool(int, int, int)>& is_known) {
  Sampled out{size, {}, {}};
  for (int z = 0; z < size[2]; ++z)
    for (int y = 0; y < size[1]; ++y)
      for (int x = 0; x < size[0]; ++x) {
        const bool known = is_known(x, y, z);
        out.known.push_back(known ? Knowledge::value : Knowledge::nothing);
        out.values.push_back(known ? float(of(x, y, z)) : 7.0f);
      }
  return out;
}

/// Far from the middle of a grid of 48 nodes.
bool is_outside_ball(int x, int y, int z) { return std::hypot(x - 24, y - 24, z - 24) > 12; }

TEST(ThinPlate, APlaneGoesOnAsAPlane) {
  const auto plane = [](int x, int y, int z) { return 0.3 * x - 0.5 * y + 0.2 * z + 4; };
  Sampled grid = sampled({48, 48, 48}, plane, is_outside_ball);
  continue_with_least_bending(grid.size, grid.known, grid.values);
  for (int z = 0; z < 48; ++z)
    for (int y = 0; y < 48; ++y)
      for (int x = 0; x < 48; ++x)
        ASSERT_NEAR(grid.values[node_index(grid.size, x, y, z)], plane(x, y, z), 0.02) << x << ' ' << y << ' ' << z;
}

TEST(ThinPlate, GoesOnBeyondWhatIsKnownOnOneSideAlone) {
  const auto plane = [](int x, int, int) { return 0.5 * x - 12; };
  Sampled grid = sampled({48, 48, 48}, plane, [](int x, int, int) { return x < 20; });
  continue_with_least_bending(grid.size, grid.known, grid.values);
  // Far out the sweeps have not settled: some of the way is missing.
  for (int x = 20; x < 48; ++x)
    EXPECT_NEAR(grid.values[node_index(grid.size, x, 24, 24)], plane(x, 0, 0), 0.5 + 0.1 * (x - 20)) << x;
}

TEST(ThinPlate, KeepsWithinBounds) {
  // It would sink below 0 in the ball, where somebody has looked through one half and nobody through the other.
  Sampled grid = sampled(
      {48, 48, 48}, [](int, int, int z) { return z < 24 ? 1 - 0.1 * z : 1 - 0.1 * (47 - z); }, is_outside_ball);
  for (int z = 0; z < 48; ++z)
    for (int y = 0; y < 48; ++y)
      for (int x = 0; x < 24; ++x)
        if (const std::size_t node = node_index(grid.size, x, y, z); grid.known[node] == Knowledge::nothing)
          grid.known[node] = Knowledge::not_negative;
  continue_with_least_bending(grid.size, grid.known, grid.values);
  for (std::size_t node = 0; node < grid.known.size(); ++node)
    if (grid.known[node] == Knowledge::not_negative) {
      ASSERT_GE(grid.values[node], 0);
    }
  EXPECT_LT(grid.values[node_index(grid.size, 32, 24, 24)], -0.1);
}

TEST(ThinPlate, WhereNothingIsKnownEverythingStays) {
  Sampled grid = sampled({20, 20, 20}, {}, [](int, int, int) { return false; });
  continue_with_least_bending(grid.size, grid.known, grid.values);
  EXPECT_EQ(grid.values, std::vector<float>(8000, 7.0f));
}

TEST(ThinPlate, WhatIsFarFromTheUnknownStays) {
  Sampled grid = sampled(
      {48, 48, 48}, [](int x, int y, int z) { return std::sin(x + 2.0 * y + 3.0 * z); },
      [](int x, int y, int z) { return x + y + z > 0; });
  // A sheet that somebody has looked through, one node thin, between what is behind something else.
  for (int y = 20; y < 40; ++y)
    for (int x = 30; x < 33; ++x) {
      const std::size_t node = node_index(grid.size, x, y, 30);
      grid.known[node] = x == 31 ? Knowledge::not_negative : Knowledge::not_positive;
      grid.values[node] = x == 31 ? 3.0f : -3.0f;
    }
  const std::vector<float> before = grid.values;
  continue_with_least_bending(grid.size, grid.known, grid.values);
  EXPECT_NE(grid.values[0], before[0]);
  EXPECT_NE(grid.values[1], before[1]) << "smoothed";
  for (std::size_t node = node_index(grid.size, 0, 0, 9); node < before.size(); ++node)
    ASSERT_EQ(grid.values[node], before[node]) << node;
}

TEST(ThinPlate, StandsGridsOfAFewNodes) {
  for (const GridSize& size : {GridSize{1, 1, 1}, {2, 1, 1}, {1, 5, 1}, {3, 3, 1}, {100, 1, 1}}) {
    Sampled grid = sampled(
        size, [](int x, int y, int) { return x + y; }, [](int x, int y, int) { return x + y < 2; });
    continue_with_least_bending(grid.size, grid.known, grid.values);
    EXPECT_TRUE(std::ranges::all_of(grid.values, [](float value) { return std::isfinite(value); })) << size[0];
  }
}

TEST(ThinPlate, WhereTwoPlanesMeetTheyMeet) {
  // The distance to a floor, z = 8, and a wall, x = 8, seen but for a ball that touches both.
  const auto distance = [](int x, int, int z) { return std::min(x, z) - 8.0; };
  Sampled grid =
      sampled({48, 48, 48}, distance, [](int x, int y, int z) { return std::hypot(x - 14, y - 24, z - 14) > 10; });
  continue_with_least_bending(grid.size, grid.known, grid.values);
  for (int k = 14; k < 24; ++k) {
    EXPECT_NEAR(grid.values[node_index(grid.size, k, 24, 8)], 0, 1.0) << "on the floor, " << k;
    EXPECT_NEAR(grid.values[node_index(grid.size, 8, 24, k)], 0, 1.0) << "on the wall, " << k;
  }
  EXPECT_GT(grid.values[node_index(grid.size, 12, 24, 12)], 0.5) << "no tent is before the corner";
}

TEST(ThinPlate, TheSameForAnyNumberOfThreads) {
  const auto run = [](int threads) {
    Sampled grid = sampled(
        {48, 48, 48}, [](int x, int y, int z) { return std::sin(0.2 * x) + 0.1 * y * z; }, is_outside_ball);
    WorkArena(threads).run([&] { continue_with_least_bending(grid.size, grid.known, grid.values); });
    return grid.values;
  };
  EXPECT_EQ(run(1), run(4));
}

}  // namespace
}  // namespace engine::repair
