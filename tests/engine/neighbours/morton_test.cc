#include "engine/neighbours/morton.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "engine/core/rng.h"

namespace engine::neighbours {
namespace {

using Order = std::vector<std::uint32_t>;

/// Sum of the ways from each point to the next, for points in an order.
double way(const std::vector<float>& points, const Order& order) {
  double sum = 0;
  for (std::size_t i = 1; i < order.size(); ++i) {
    double squared = 0;
    for (std::size_t axis = 0; axis < 3; ++axis)
      squared += std::pow(double(points[3 * order[i] + axis]) - double(points[3 * order[i - 1] + axis]), 2.0);
    sum += std::sqrt(squared);
  }
  return sum;
}

TEST(MortonOrder, TakesTheEightCornersOfACubeWithXFastest) {
  std::vector<float> corners;
  for (const float z : {1.0f, -1.0f})
    for (const float y : {1.0f, -1.0f})
      for (const float x : {1.0f, -1.0f}) corners.insert(corners.end(), {x, y, z});
  EXPECT_EQ(morton_order(corners), (Order{7, 6, 5, 4, 3, 2, 1, 0}));
}

TEST(MortonOrder, IsAnOrderOfAllPointsAndAShorterWayThroughThem) {
  Rng rng(3);
  std::vector<float> points(3 * 5000);
  for (float& value : points) value = rng.uniform(-2.0f, 5.0f);
  const Order order = morton_order(points);
  Order sorted = order, given(5000);
  std::ranges::sort(sorted);
  std::iota(given.begin(), given.end(), 0u);
  EXPECT_EQ(sorted, given);
  EXPECT_LT(way(points, order), 0.15 * way(points, given));
}

TEST(MortonOrder, PointsOfACellStayInTheirOrder) {
  EXPECT_EQ(morton_order(std::vector<float>{2, 2, 2, 2, 2, 2, 2, 2, 2}), (Order{0, 1, 2}));
}

TEST(MortonOrder, OfNoPointIsEmpty) { EXPECT_TRUE(morton_order({}).empty()); }

TEST(MortonOrder, PointsAtTheEndsOfTheRangeOfFloatsAreOrdered) {
  constexpr float most = std::numeric_limits<float>::max();
  EXPECT_EQ(morton_order(std::vector<float>{most, most, most, 0, 0, 0, -most, -most, -most}), (Order{2, 1, 0}));
}

}  // namespace
}  // namespace engine::neighbours
