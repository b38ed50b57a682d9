#include "engine/select/random_walk.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "tests/engine/select/weighted_graphs.h"

namespace engine::select {
namespace {

std::vector<double> walk(const WeightedGraph& on, const std::vector<std::uint32_t>& inside,
                         const std::vector<std::uint32_t>& outside) {
  std::vector<Given> given(on.graph.size(), Given::no);
  for (const std::uint32_t node : inside) given[node] = Given::inside;
  for (const std::uint32_t node : outside) given[node] = Given::outside;
  return random_walk(on.graph, on.weight, given);
}

TEST(RandomWalk, FallsEvenlyAlongAChain) {
  const std::vector<double> x = walk(graph_of(5, chain(0, 5)), {0}, {4});
  for (std::size_t node = 0; node < 5; ++node) EXPECT_NEAR(x[node], 1 - 0.25 * double(node), 1e-4);
}

TEST(RandomWalk, DropsWhereAnEdgeIsWeak) {
  // As voltages do along resistors of 1, 10 and 1.
  const std::vector<double> x = walk(graph_of(4, {{0, 1, 1}, {1, 2, 0.1f}, {2, 3, 1}}), {0}, {3});
  EXPECT_NEAR(x[1], 11.0 / 12, 1e-4);
  EXPECT_NEAR(x[2], 1.0 / 12, 1e-4);
}

TEST(RandomWalk, StandsWhatIsGivenForNobodyAndWhatIsAlone) {
  const WeightedGraph two_chains = graph_of(7, [] {
    auto edges = chain(0, 3);
    for (const WeightedEdge& edge : chain(3, 6)) edges.push_back(edge);
    return edges;  // node 6 is alone
  }());
  EXPECT_EQ(walk(two_chains, {}, {}), std::vector<double>(7, 0.0));
  const std::vector<double> x = walk(two_chains, {1}, {});
  for (const std::size_t node : {0u, 1u, 2u}) EXPECT_NEAR(x[node], 1, 1e-4) << node;
  for (const std::size_t node : {3u, 4u, 5u, 6u}) EXPECT_EQ(x[node], 0) << node;
  EXPECT_EQ(walk(graph_of(1, {}), {0}, {}), std::vector<double>{1.0});
  EXPECT_TRUE(random_walk({.begin = {0}, .to = {}, .back = {}, .length = {}, .spacing = {}}, {}, {}).empty());
}

TEST(RandomWalk, ALeakIsAnEdgeToTheOutside) {
  WeightedGraph leaking = graph_of(4, chain(0, 4));
  const std::vector<Given> given{Given::inside, Given::no, Given::no, Given::no};
  const std::vector<double> x = random_walk(leaking.graph, leaking.weight, given, std::vector<float>{0, 0, 0, 1});
  for (std::size_t node = 0; node < 4; ++node) EXPECT_NEAR(x[node], 1 - 0.25 * double(node), 1e-4);
}

TEST(RandomWalk, StandsEdgesWithoutWeight) {
  const std::vector<double> x = walk(graph_of(3, {{0, 1, 0}, {1, 2, 0}}), {0}, {2});
  EXPECT_EQ(x, (std::vector<double>{1, 0, 0}));
}

/// A grid that is made coarser several times, with weights over three orders of magnitude.
WeightedGraph rough_grid(std::uint32_t side) {
  std::vector<WeightedEdge> edges = grid(side);
  Rng rng(5);
  for (WeightedEdge& edge : edges) edge.weight = float(std::pow(10.0, -3.0 * double(rng.uniform())));
  return graph_of(std::size_t(side) * side, edges);
}

TEST(RandomWalk, LeaksAreMergedWithTheirNodes) {
  constexpr std::uint32_t side = 60;
  const WeightedGraph on = rough_grid(side);
  std::vector<WeightedEdge> edges;
  for (std::uint32_t node = 0; node < side * side; ++node)
    for (std::uint32_t edge = on.graph.begin[node]; edge < on.graph.begin[node + 1]; ++edge)
      if (node < on.graph.to[edge]) edges.push_back({node, on.graph.to[edge], on.weight[edge]});
  std::vector<float> leak(side * side);
  for (std::uint32_t node = 0; node < leak.size(); ++node) {
    leak[node] = 1e-4f * float(node % side);
    edges.push_back({node, side * side, leak[node]});
  }
  std::vector<Given> given(leak.size(), Given::no);
  given[side * side / 2] = Given::inside;
  const std::vector<double> leaking = random_walk(on.graph, on.weight, given, leak);
  given.push_back(Given::outside);
  const WeightedGraph explicitly = graph_of(side * side + 1, edges);
  const std::vector<double> x = random_walk(explicitly.graph, explicitly.weight, given);
  for (std::size_t node = 0; node < leak.size(); ++node) ASSERT_NEAR(leaking[node], x[node], 1e-3) << node;
  EXPECT_LT(*std::ranges::min_element(leaking), 0.9) << "they count";
}

TEST(RandomWalk, IsTheMeanOfItsNeighboursOnALargeGraph) {
  constexpr std::uint32_t side = 120;
  const WeightedGraph rough = rough_grid(side);
  const std::uint32_t inside = side / 4 * (side + 1), outside = 3 * side / 4 * (side + 1);
  const std::vector<double> x = walk(rough, {inside}, {outside});
  double worst = 0, sum = 0;
  for (std::uint32_t node = 0; node < x.size(); ++node) {
    ASSERT_GE(x[node], 0);
    ASSERT_LE(x[node], 1);
    if (node == inside || node == outside) continue;
    double mean = 0, degree = 0;
    for (std::uint32_t edge = rough.graph.begin[node]; edge < rough.graph.begin[node + 1]; ++edge) {
      mean += double(rough.weight[edge]) * x[rough.graph.to[edge]];
      degree += double(rough.weight[edge]);
    }
    const double off = std::abs(x[node] - mean / degree);
    worst = std::max(worst, off);
    sum += off;
  }
  EXPECT_LT(worst, 0.02);
  EXPECT_LT(sum / double(x.size()), 1e-4);
}

/// The same by conjugate gradients to rounding, without any graph of merged nodes.
std::vector<double> reference(const WeightedGraph& graph, std::uint32_t inside, std::uint32_t outside) {
  const std::size_t n = graph.graph.size();
  const auto is_free = [&](std::size_t node) { return node != inside && node != outside; };
  const auto laplacian = [&](const std::vector<double>& x) {
    std::vector<double> out(n, 0.0);
    for (std::uint32_t node = 0; node < n; ++node)
      for (std::uint32_t edge = graph.graph.begin[node]; edge < graph.graph.begin[node + 1]; ++edge)
        if (is_free(node)) out[node] += double(graph.weight[edge]) * (x[node] - x[graph.graph.to[edge]]);
    return out;
  };
  const auto product = [](const std::vector<double>& a, const std::vector<double>& b) {
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
  };
  std::vector<double> x(n, 0.0);
  x[inside] = 1;
  std::vector<double> residual = laplacian(x);
  for (double& one : residual) one = -one;
  std::vector<double> direction = residual;
  double size = product(residual, residual);
  for (int step = 0; step < 20'000 && size > 1e-26; ++step) {
    const std::vector<double> along = laplacian(direction);
    const double length = size / product(direction, along);
    for (std::size_t node = 0; node < n; ++node)
      x[node] += length * direction[node], residual[node] -= length * along[node];
    const double next = product(residual, residual);
    for (std::size_t node = 0; node < n; ++node) direction[node] = residual[node] + next / size * direction[node];
    size = next;
  }
  return x;
}

TEST(RandomWalk, IsThatOfAPlainSolverOnALargeGraph) {
  const WeightedGraph rough = rough_grid(120);
  const std::vector<double> x = walk(rough, {30 * 121}, {90 * 121}), exact = reference(rough, 30 * 121, 90 * 121);
  double worst = 0;
  for (std::size_t node = 0; node < x.size(); ++node) worst = std::max(worst, std::abs(x[node] - exact[node]));
  EXPECT_LT(worst, 1e-3);
  const auto [least, most] = std::ranges::minmax(exact);
  EXPECT_GT(most - least, 0.9) << "there is something to be wrong about";
}

TEST(RandomWalk, GivesTheSameBytesForAnyNumberOfThreads) {
  const WeightedGraph rough = rough_grid(120);
  std::vector<double> one, four;
  WorkArena(1).run([&] { one = walk(rough, {7}, {14'000}); });
  WorkArena(4).run([&] { four = walk(rough, {7}, {14'000}); });
  EXPECT_EQ(one, four);
}

}  // namespace
}  // namespace engine::select
