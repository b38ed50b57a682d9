#include "engine/neighbours/neighbour_graph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "engine/core/rng.h"

namespace engine::neighbours {
namespace {

NeighbourGraph joined(const std::vector<float>& points, std::size_t k) {
  return join_nearest(points, PointIndex(points, 3), k);
}

double distance_of(const std::vector<float>& points, std::size_t a, std::size_t b) {
  double squared = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double step = double(points[3 * a + axis]) - double(points[3 * b + axis]);
    squared += step * step;
  }
  return std::sqrt(squared);
}

bool is_joined(const NeighbourGraph& graph, std::uint32_t a, std::uint32_t b) {
  return std::find(graph.to.begin() + graph.begin[a], graph.to.begin() + graph.begin[a + 1], b) !=
         graph.to.begin() + graph.begin[a + 1];
}

void expect_undirected(const NeighbourGraph& graph) {
  for (std::uint32_t node = 0; node < graph.size(); ++node)
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
      EXPECT_NE(graph.to[edge], node);
      if (edge > graph.begin[node]) {
        EXPECT_LT(graph.to[edge - 1], graph.to[edge]);
      }
      EXPECT_EQ(graph.to[graph.back[edge]], node);
      EXPECT_EQ(graph.back[graph.back[edge]], edge);
      EXPECT_EQ(graph.length[graph.back[edge]], graph.length[edge]);
    }
}

TEST(JoinNearest, IsThatOfAllPairs) {
  constexpr std::uint32_t n = 150;
  constexpr std::size_t k = 5;
  std::vector<float> points;
  Rng rng(1);
  for (std::size_t i = 0; i < 3 * n; ++i) points.push_back(rng.uniform());
  const NeighbourGraph graph = joined(points, k);
  expect_undirected(graph);
  std::vector<std::vector<std::uint32_t>> nearest(n);
  for (std::uint32_t a = 0; a < n; ++a) {
    std::vector<std::pair<double, std::uint32_t>> others;
    for (std::uint32_t b = 0; b < n; ++b)
      if (b != a) others.emplace_back(distance_of(points, a, b), b);
    std::sort(others.begin(), others.end());
    double sum = 0;
    for (std::size_t i = 0; i < k; ++i) nearest[a].push_back(others[i].second), sum += others[i].first;
    EXPECT_NEAR(double(graph.spacing[a]), sum / double(k), 1e-6) << a;
  }
  const auto has = [&](std::uint32_t a, std::uint32_t b) {
    return std::find(nearest[a].begin(), nearest[a].end(), b) != nearest[a].end();
  };
  for (std::uint32_t a = 0; a < n; ++a)
    for (std::uint32_t b = 0; b < n; ++b) EXPECT_EQ(is_joined(graph, a, b), a != b && (has(a, b) || has(b, a)));
}

TEST(JoinNearest, JoinsDensePiecesThatHangTogether) {
  // Two clumps of ten, whose two nearest are all their own; a third one too far away.
  std::vector<float> points;
  for (const float middle : {0.0f, 1.0f, 9.0f})
    for (int i = 0; i < 10; ++i) points.insert(points.end(), {middle + 0.08f * float(i), 0, 0});
  const NeighbourGraph graph = joined(points, 2);
  expect_undirected(graph);
  EXPECT_TRUE(is_joined(graph, 9, 10)) << "0.28 apart at a spacing of 0.12";
  for (std::uint32_t a = 0; a < 20; ++a)
    for (std::uint32_t b = 20; b < 30; ++b) EXPECT_FALSE(is_joined(graph, a, b));
}

TEST(JoinNearest, OfFewOrEqualPointsIsFine) {
  EXPECT_EQ(joined({}, 8).size(), 0u);
  EXPECT_TRUE(joined({1, 2, 3}, 8).to.empty());
  const NeighbourGraph pair = joined({0, 0, 0, 3, 4, 0}, 8);
  EXPECT_EQ(pair.to, (std::vector<std::uint32_t>{1, 0}));
  EXPECT_EQ(pair.length, (std::vector<float>{5, 5}));
  const NeighbourGraph same = joined(std::vector<float>(3 * 40, 1.0f), 4);
  expect_undirected(same);
  for (std::uint32_t node = 0; node < 40; ++node) EXPECT_LT(same.begin[node], same.begin[node + 1]) << node;
}

TEST(NearestRows, AreRowsNearestFirst) {
  Array3 mean;
  mean.resize(6);
  for (std::size_t row = 0; row < 6; ++row) mean.set(row, {1e6f + float(row), 0, 0});
  const std::vector<std::uint32_t> rows{1, 3, 5}, of{4, 0};
  EXPECT_EQ(nearest_rows(mean, rows, of, 2), (std::vector<std::uint32_t>{3, 5, 1, 3}));
  EXPECT_EQ(nearest_rows(mean, rows, of, 9).size(), 6u) << "no more than there are";
  EXPECT_TRUE(nearest_rows(mean, {}, of, 2).empty());
  EXPECT_TRUE(nearest_rows(mean, rows, {}, 2).empty());
}

TEST(PointsOf, KeepTheDigitsFarFromTheOriginAndAnEnd) {
  Array3 mean;
  mean.push_back({1e6f, 0, 0});
  mean.push_back({1e6f + 0.0625f, 0, 3e38f});
  const std::vector<std::uint32_t> rows{1};
  EXPECT_EQ(points_of(mean, rows, {1e6, 0, 0}), (std::vector<float>{0.0625f, 0, 1e18f}));
}

}  // namespace
}  // namespace engine::neighbours
