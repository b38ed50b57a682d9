#include "engine/select/leftovers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "engine/core/parallel.h"
#include "tests/engine/select/weighted_graphs.h"

namespace engine::select {
namespace {

constexpr std::uint32_t side = 15, thing = side * side;  // nodes 0 to 224: a thing, all of it inside
constexpr std::uint32_t floor_side = 20, floor_begin = 300, nodes = floor_begin + floor_side * floor_side;

/// A thing and a floor, two grids, and between them a leg of so many nodes, 225 and on: a chain.
///   above, below  weights of the edges by which the leg hangs on and stands
WeightedGraph on_a_leg(std::uint32_t length, float above, float below) {
  std::vector<WeightedEdge> edges = grid(side);
  for (const WeightedEdge& edge : grid(floor_side))
    edges.push_back({edge.a + floor_begin, edge.b + floor_begin, edge.weight});
  for (const WeightedEdge& edge : chain(thing, thing + length)) edges.push_back(edge);
  edges.push_back({0, thing, above});
  edges.push_back({thing + length - 1, floor_begin + floor_side * 10 + 10, below});
  return graph_of(nodes, edges);
}

struct Taken {
  std::size_t thing = 0, leg = 0, floor = 0;
  bool operator==(const Taken&) const = default;
};

/// How much is inside afterwards. The rim of the floor is given for the outside.
Taken taken(const WeightedGraph& on, const std::vector<std::uint32_t>& clicked = {},
            const std::vector<std::uint32_t>& outside = {}) {
  std::vector<Given> given(nodes, Given::no);
  for (std::uint32_t x = 0; x < floor_side; ++x) given[floor_begin + x] = Given::outside;
  for (const std::uint32_t node : outside) given[node] = Given::outside;
  std::vector<std::uint8_t> inside(nodes, 0);
  std::fill_n(inside.begin(), thing, std::uint8_t{1});
  take_leftovers(on.graph, on.weight, given, clicked, inside);
  const auto count = [&](std::uint32_t begin, std::uint32_t end) {
    return std::size_t(std::count(inside.begin() + begin, inside.begin() + end, std::uint8_t{1}));
  };
  return {count(0, thing), count(thing, floor_begin), count(floor_begin, nodes)};
}

TEST(Leftovers, AreWhatHangsOnByTheThingNearlyAsFirmlyAsByTheRest) {
  EXPECT_EQ(taken(on_a_leg(20, 1.0f, 0.1f)), (Taken{thing, 20, 0}));
  EXPECT_EQ(taken(on_a_leg(20, 0.1f, 0.1f)), (Taken{thing, 20, 0})) << "of another colour than either";
  EXPECT_EQ(taken(on_a_leg(20, 0.06f, 0.1f)), (Taken{thing, 20, 0}));
}

TEST(Leftovers, AreNotWhatHangsOnByTheRest) {
  EXPECT_EQ(taken(on_a_leg(20, 0.04f, 0.1f)), (Taken{thing, 0, 0}));
  EXPECT_EQ(taken(on_a_leg(20, 0.001f, 1.0f)), (Taken{thing, 0, 0}));
}

TEST(Leftovers, AreLittleBesideTheThing) {
  EXPECT_EQ(taken(on_a_leg(33, 1.0f, 0.1f)), (Taken{thing, 33, 0}));
  EXPECT_EQ(taken(on_a_leg(34, 1.0f, 0.1f)), (Taken{thing, 0, 0})) << "a thing of its own, and not cut in two either";
}

TEST(Leftovers, AreNotNextToWhereSomebodyClickedOutside) {
  const std::uint32_t under_leg = floor_begin + floor_side * 10 + 10, far_off = floor_begin + floor_side * 10 + 14;
  EXPECT_EQ(taken(on_a_leg(20, 1.0f, 0.1f), {under_leg}, {under_leg}), (Taken{thing, 0, 0}));
  EXPECT_EQ(taken(on_a_leg(20, 1.0f, 0.1f), {far_off}, {far_off}), (Taken{thing, 20, 0}));
}

TEST(Leftovers, AreNotCutOutOfWhatGoesOn) {
  EXPECT_EQ(taken(on_a_leg(20, 1.0f, 0.5f)), (Taken{thing, 0, 0})) << "a pole that thing and floor both grow out of";
  EXPECT_EQ(taken(on_a_leg(20, 1.0f, 0.1f), {}, {thing + 10}), (Taken{thing, 0, 0})) << "half of a leg";
}

TEST(Leftovers, AreNothingOfAFloorThatTheThingStandsOn) {
  std::vector<WeightedEdge> edges = grid(side);
  for (const WeightedEdge& edge : grid(floor_side))
    edges.push_back({edge.a + floor_begin, edge.b + floor_begin, edge.weight});
  for (std::uint32_t x = 0; x < side; ++x) edges.push_back({x, floor_begin + floor_side * 10 + x, 0.3f});
  EXPECT_EQ(taken(graph_of(nodes, edges)), (Taken{thing, 0, 0}));
}

TEST(Leftovers, AreTheSameForAnyNumberOfThreads) {
  const WeightedGraph on = on_a_leg(20, 0.06f, 0.1f);
  for (const int threads : {1, 2, 4}) {
    Taken found;
    WorkArena(threads).run([&] { found = taken(on); });
    EXPECT_EQ(found, (Taken{thing, 20, 0})) << threads;
  }
}

TEST(Leftovers, OfNothingOrWithoutEdgesAreNone) {
  const WeightedGraph on = on_a_leg(20, 0.0f, 0.0f);
  std::vector<std::uint8_t> inside(nodes, 0);
  take_leftovers(on.graph, on.weight, std::vector<Given>(nodes, Given::no), {}, inside);
  EXPECT_EQ(std::count(inside.begin(), inside.end(), std::uint8_t{1}), 0);
  EXPECT_EQ(taken(on), (Taken{thing, 0, 0})) << "a leg in the air";
  EXPECT_EQ(taken(graph_of(nodes, {{0, 1, 0.0f}})), (Taken{thing, 0, 0}));
}

}  // namespace
}  // namespace engine::select
