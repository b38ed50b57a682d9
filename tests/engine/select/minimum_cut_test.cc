#include "engine/select/minimum_cut.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <vector>

#include "engine/core/rng.h"

namespace engine::select {
namespace {

struct Problem {
  NeighbourGraph graph;
  std::vector<std::int32_t> capacity, pull;
};

/// A random graph; about a third of the nodes are certain.
Problem random_problem(std::uint32_t nodes, std::uint64_t seed) {
  Rng rng(seed);
  std::vector<std::vector<std::int32_t>> matrix(nodes, std::vector<std::int32_t>(nodes, 0));
  for (std::uint32_t a = 0; a < nodes; ++a)
    for (std::uint32_t b = 0; b < a; ++b)
      if (rng.below(3) == 0) matrix[a][b] = matrix[b][a] = std::int32_t(1 + rng.below(20));
  Problem out;
  out.graph.begin.push_back(0);
  std::vector<std::vector<std::uint32_t>> number(nodes, std::vector<std::uint32_t>(nodes, 0));
  for (std::uint32_t a = 0; a < nodes; ++a) {
    for (std::uint32_t b = 0; b < nodes; ++b) {
      if (matrix[a][b] == 0) continue;
      number[a][b] = std::uint32_t(out.graph.to.size());
      out.graph.to.push_back(b);
      out.capacity.push_back(matrix[a][b]);
    }
    out.graph.begin.push_back(std::uint32_t(out.graph.to.size()));
    out.graph.spacing.push_back(1);
    const std::uint32_t kind = rng.below(6);
    out.pull.push_back(kind == 0 ? certainly_inside : kind == 1 ? certainly_outside : std::int32_t(rng.below(41)) - 20);
  }
  for (std::uint32_t a = 0; a < nodes; ++a)
    for (std::uint32_t edge = out.graph.begin[a]; edge < out.graph.begin[a + 1]; ++edge)
      out.graph.back.push_back(number[out.graph.to[edge]][a]);
  return out;
}

/// What a division costs; the most there is if it goes against a certain node.
std::int64_t cost_of(const Problem& problem, const std::vector<std::uint8_t>& inside) {
  std::int64_t cost = 0;
  for (std::size_t node = 0; node < inside.size(); ++node) {
    const std::int32_t pull = problem.pull[node];
    const bool follows = pull == 0 || (pull > 0) == (inside[node] != 0);
    if (!follows && std::abs(pull) == certainly_inside) return std::numeric_limits<std::int64_t>::max();
    if (!follows) cost += std::abs(pull);
    for (std::uint32_t edge = problem.graph.begin[node]; edge < problem.graph.begin[node + 1]; ++edge)
      if (problem.graph.to[edge] < node && inside[problem.graph.to[edge]] != inside[node])
        cost += problem.capacity[edge];
  }
  return cost;
}

TEST(MinimumCut, IsTheCheapestOfAllDivisions) {
  constexpr std::uint32_t nodes = 11;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const Problem problem = random_problem(nodes, seed);
    const auto found = minimum_cut(problem.graph, problem.capacity, problem.pull);
    std::int64_t least = std::numeric_limits<std::int64_t>::max();
    std::ptrdiff_t fewest = nodes + 1;
    for (std::uint32_t bits = 0; bits < 1u << nodes; ++bits) {
      std::vector<std::uint8_t> inside(nodes);
      for (std::uint32_t node = 0; node < nodes; ++node) inside[node] = bits >> node & 1;
      const std::int64_t cost = cost_of(problem, inside);
      const std::ptrdiff_t count = std::count(inside.begin(), inside.end(), 1);
      if (cost < least) least = cost, fewest = count;
      if (cost == least) fewest = std::min(fewest, count);
    }
    EXPECT_EQ(cost_of(problem, found), least) << seed;
    EXPECT_EQ(std::count(found.begin(), found.end(), 1), fewest) << seed;
  }
}

TEST(MinimumCut, OfNothingIsNothing) {
  NeighbourGraph empty;
  empty.begin = {0};
  EXPECT_TRUE(minimum_cut(empty, {}, {}).empty());
}

}  // namespace
}  // namespace engine::select
