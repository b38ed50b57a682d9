#include "engine/neighbours/point_index.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"

namespace engine::neighbours {
namespace {

std::vector<float> random_points(std::size_t values, std::uint64_t seed) {
  std::vector<float> points(values);
  Rng rng(seed);
  for (float& value : points) value = rng.uniform(-2.0f, 3.0f);
  return points;
}

/// Looks at every point.
std::vector<Neighbour> nearest_by_scan(const std::vector<float>& points, std::size_t dimensions, const float* query,
                                       std::size_t k) {
  std::vector<Neighbour> all;
  for (std::size_t i = 0; i * dimensions < points.size(); ++i) {
    float squared = 0;
    for (std::size_t d = 0; d < dimensions; ++d) {
      const float difference = query[d] - points[i * dimensions + d];
      squared += difference * difference;
    }
    all.push_back({std::uint32_t(i), squared});
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Neighbour& a, const Neighbour& b) { return a.squared_distance < b.squared_distance; });
  all.resize(std::min(all.size(), k));
  return all;
}

void expect_as_by_scan(const std::vector<float>& points, std::size_t dimensions, const std::vector<float>& queries,
                       std::size_t k) {
  const PointIndex index(points, dimensions);
  const auto found = index.nearest(queries, k);
  const std::size_t count = queries.size() / dimensions, kept = std::min(k, index.size());
  ASSERT_EQ(found.size(), count * kept);
  for (std::size_t q = 0; q < count; ++q) {
    const auto expected = nearest_by_scan(points, dimensions, queries.data() + q * dimensions, k);
    EXPECT_TRUE(std::equal(expected.begin(), expected.end(), found.begin() + std::ptrdiff_t(q * kept)))
        << "query " << q;
  }
}

TEST(PointIndex, FindsWhatLookingAtEveryPointFinds) {
  for (const std::size_t dimensions : {1u, 3u, 16u})
    expect_as_by_scan(random_points(500 * dimensions, 1), dimensions, random_points(40 * dimensions, 2), 7);
}

TEST(PointIndex, OfEquallyFarPointsTakesTheLowerIndex) {
  std::vector<float> grid;  // of whole numbers: distances are exact, and ties are many
  for (int x = 0; x < 12; ++x)
    for (int y = 0; y < 12; ++y) grid.insert(grid.end(), {float(x), float(y)});
  for (const std::size_t k : {1u, 2u, 3u, 5u, 20u}) expect_as_by_scan(grid, 2, grid, k);
}

TEST(PointIndex, TakesPointsThatAllCoincide) {
  expect_as_by_scan(std::vector<float>(3 * 200, 0.5f), 3, {0.5f, 0.5f, 0.5f, 1.0f, 0.0f, 2.0f}, 4);
}

TEST(PointIndex, HasFewerNeighboursThanAskedForWhereThereAreFewerPoints) {
  expect_as_by_scan({1, 2, 3, 4, 5, 6}, 3, {0, 0, 0}, 5);
  EXPECT_TRUE(PointIndex({}, 3).nearest(std::vector<float>{0, 0, 0}, 5).empty());
  EXPECT_TRUE(PointIndex(std::vector<float>{1, 2, 3}, 3).nearest(std::vector<float>{0, 0, 0}, 0).empty());
}

TEST(PointIndex, SaysWhetherAPointIsWithinADistance) {
  for (const std::size_t dimensions : {1u, 3u}) {
    const std::vector<float> points = random_points(500 * dimensions, 4), queries = random_points(60 * dimensions, 5);
    std::vector<float> radii(60);
    for (std::size_t q = 0; q < radii.size(); ++q) radii[q] = 0.01f * float(q);
    const auto has = PointIndex(points, dimensions).has_within(queries, radii);
    ASSERT_EQ(has.size(), radii.size());
    for (std::size_t q = 0; q < radii.size(); ++q) {
      const auto nearest = nearest_by_scan(points, dimensions, queries.data() + q * dimensions, 1);
      EXPECT_EQ(has[q] != 0, nearest[0].squared_distance <= radii[q] * radii[q]) << "query " << q;
    }
  }
}

TEST(PointIndex, CountsWhatIsExactlyAsFarAsWithin) {
  const PointIndex index(std::vector<float>{1, 2, 3}, 3);
  const std::vector<float> queries{1, 2, 3, 1, 2, 3.5f, 1, 2, 3.5f};
  EXPECT_EQ(index.has_within(queries, std::vector<float>{0, 0.5f, 0.49f}), (std::vector<std::uint8_t>{1, 1, 0}));
  EXPECT_EQ(PointIndex({}, 3).has_within(queries, std::vector<float>{9, 9, 9}), (std::vector<std::uint8_t>{0, 0, 0}));
}

TEST(PointIndex, GivesTheSameForAnyNumberOfThreads) {
  const std::vector<float> points = random_points(3 * 2000, 3);
  const PointIndex index(points, 3);
  std::vector<Neighbour> one, four;
  WorkArena(1).run([&] { one = index.nearest(points, 4); });
  WorkArena(4).run([&] { four = index.nearest(points, 4); });
  EXPECT_EQ(one, four);
}

}  // namespace
}  // namespace engine::neighbours
