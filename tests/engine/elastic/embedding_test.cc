#include "engine/elastic/embedding.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>
#include <vector>

#include "engine/core/parallel.h"
#include "tests/engine/elastic/shapes_of_points.h"

namespace engine::elastic {
namespace {

std::size_t pieces_of(const Graph& graph) {
  neighbours::Pieces pieces(graph.size());
  for (std::uint32_t i = 0; i < graph.size(); ++i)
    for (std::uint32_t edge = graph.begin[i]; edge < graph.begin[i + 1]; ++edge) pieces.join(i, graph.to[edge]);
  const auto sizes = pieces.sizes();
  return sizes.size() - std::size_t(std::ranges::count(sizes, 0u));
}

void expect_sound(const Embedding& found, std::size_t points) {
  EXPECT_EQ(found.cell.size(), points);
  ASSERT_EQ(found.begin.size(), points + 1);
  for (std::size_t i = 0; i < points; ++i) {
    double sum = 0;
    for (std::uint32_t at = found.begin[i]; at < found.begin[i + 1]; ++at) {
      EXPECT_LT(found.node[at], found.graph.size());
      EXPECT_GT(found.weight[at], 0);
      sum += double(found.weight[at]);
    }
    EXPECT_NEAR(sum, 1, 1e-5) << i;
  }
  EXPECT_EQ(pieces_of(found.graph), 1u);
}

TEST(Embed, SpreadsNodesEvenly) {
  std::vector<float> points;
  add_sheet(points, 60, 40, 0.1f, 0);
  const Embedding found = embed(points, joined(points), {}, {60});
  expect_sound(found, points.size() / 3);
  ASSERT_EQ(found.graph.size(), 60u);
  std::vector<double> nearest;
  for (std::size_t i = 0; i < found.graph.size(); ++i) {
    double least = 1e9;
    for (std::size_t j = 0; j < found.graph.size(); ++j)
      if (i != j) least = std::min(least, glm::distance(found.graph.rest[i], found.graph.rest[j]));
    nearest.push_back(least);
  }
  const auto [closest, loneliest] = std::ranges::minmax_element(nearest);
  EXPECT_GT(*closest, 0.4 * *loneliest);
}

TEST(Embed, SeesNothingAcrossAGap) {
  std::vector<float> points;  // two sheets nearer to each other than nodes are, joined at no place
  add_sheet(points, 60, 40, 0.1f, 0);
  const std::size_t lower = points.size() / 3;
  add_sheet(points, 60, 40, 0.1f, 0.4f, 2);
  const Embedding found = embed(points, joined(points), {}, {80});
  expect_sound(found, points.size() / 3);
  const auto is_lower = [&](std::uint32_t node) { return found.point_of[node] < lower; };
  std::size_t across = 0;
  for (std::uint32_t i = 0; i < found.graph.size(); ++i)
    for (std::uint32_t edge = found.graph.begin[i]; edge < found.graph.begin[i + 1]; ++edge)
      across += is_lower(i) != is_lower(found.graph.to[edge]);
  EXPECT_EQ(across, 2u) << "one edge, both ways, makes them one body";
  std::size_t strays = 0;  // points near that edge follow nodes of both sides: its ends are joined
  for (std::size_t i = 0; i < points.size() / 3; ++i)
    for (std::uint32_t at = found.begin[i]; at < found.begin[i + 1]; ++at)
      strays += is_lower(found.node[at]) != (i < lower);
  EXPECT_LT(double(strays), 0.06 * double(found.node.size()));
}

TEST(Embed, LetsCrumbsGoAlong) {
  std::vector<float> points;
  add_sheet(points, 40, 40, 0.1f, 0);
  const auto sheet = std::uint32_t(points.size() / 3);
  points.insert(points.end(), {2.0f, 2.0f, 1.5f, 2.0f, 2.1f, 1.5f});
  const Embedding found = embed(points, joined(points), {}, {40});
  expect_sound(found, points.size() / 3);
  for (const std::uint32_t point : found.point_of) EXPECT_LT(point, sheet) << "a crumb is no node";
  EXPECT_LT(glm::distance(found.graph.rest[found.cell[sheet]], DVec3(2, 2, 0)), 0.6);
}

TEST(Embed, TakesSeedsFirstAndEachOnce) {
  std::vector<float> points;
  add_sheet(points, 20, 20, 0.1f, 0);
  const std::vector<std::uint32_t> seeds{17, 230, 17};
  const Embedding found = embed(points, joined(points), seeds, {10});
  ASSERT_EQ(found.graph.size(), 10u);
  EXPECT_EQ(found.point_of[0], 17u);
  EXPECT_EQ(found.point_of[1], 230u);
  EXPECT_EQ(std::set<std::uint32_t>(found.point_of.begin(), found.point_of.end()).size(), 10u);
}

TEST(Embed, OfOnePlaceIsOneNode) {
  for (const std::size_t n : {std::size_t{1}, std::size_t{3}, std::size_t{40}}) {
    SCOPED_TRACE(n);
    const std::vector<float> points(3 * n, 0.25f);
    const Embedding found = embed(points, joined(points), {}, {500});
    expect_sound(found, n);
    EXPECT_EQ(found.graph.size(), 1u);
  }
}

TEST(Embed, IsTheSameForAnyNumberOfThreads) {
  std::vector<float> points;
  add_sheet(points, 120, 90, 0.1f, 0);
  const auto graph = joined(points);
  const auto with = [&](int threads) {
    Embedding found;
    WorkArena(threads).run([&] { found = embed(points, graph, {}, {100}); });
    return found;
  };
  const Embedding one = with(1), four = with(4);
  EXPECT_EQ(one.point_of, four.point_of);
  EXPECT_EQ(one.node, four.node);
  EXPECT_EQ(one.weight, four.weight);
}

TEST(Embed, OfFewPointsLetsEachFollowItself) {
  std::vector<float> points;
  add_sheet(points, 15, 15, 0.1f, 0);
  const Embedding found = embed(points, joined(points), {}, {500});
  expect_sound(found, 225);
  ASSERT_EQ(found.graph.size(), 225u);
  EXPECT_NEAR(found.spacing, 0.12, 0.03);
  for (std::size_t i = 0; i < 225; ++i) {
    ASSERT_EQ(found.begin[i + 1] - found.begin[i], 1u);
    EXPECT_EQ(found.point_of[found.node[found.begin[i]]], i);
  }
}

TEST(PointsWithin, GoAlongTheBody) {
  std::vector<float> points;
  add_sheet(points, 30, 30, 0.1f, 0);
  const std::size_t lower = points.size() / 3;
  add_sheet(points, 30, 30, 0.1f, 0.4f, 2);
  const auto near = points_within(joined(points), 0, 1.0);
  ASSERT_FALSE(near.empty());
  EXPECT_EQ(near.front().point, 0u);
  for (const auto& [point, distance] : near) {
    EXPECT_LT(point, lower);
    EXPECT_LE(glm::distance(point_at(points, point), point_at(points, 0)), 1.0 + 1e-6);
  }
  ASSERT_EQ(points_within(joined(points), 5, 0).size(), 1u);
  EXPECT_EQ(points_within(joined(points), 5, 0)[0].point, 5u);
}

}  // namespace
}  // namespace engine::elastic
