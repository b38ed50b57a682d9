#include "engine/select/natural_border.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "tests/engine/select/weighted_graphs.h"

namespace engine::select {
namespace {

/// The nodes inside, after clicks on nodes.
std::vector<std::uint32_t> inside(const WeightedGraph& on, const ClickedNodes& clicked, const BorderChoice& choice = {},
                                  int* wider = nullptr) {
  std::vector<Given> given(on.graph.size(), Given::no);
  for (const std::uint32_t node : clicked.inside) given[node] = Given::inside;
  for (const std::uint32_t node : clicked.outside) given[node] = Given::outside;
  const std::vector<double> potential = random_walk(on.graph, on.weight, given);
  std::vector<std::uint32_t> out;
  const NaturalBorder border = natural_border(on.graph, on.weight, potential, given, clicked, choice);
  for (std::uint32_t node = 0; node < border.inside.size(); ++node)
    if (border.inside[node] != 0) out.push_back(node);
  if (wider) *wider = border.wider;
  return out;
}

std::vector<std::uint32_t> numbers(std::uint32_t from, std::uint32_t to) {
  std::vector<std::uint32_t> out(to - from);
  std::iota(out.begin(), out.end(), from);
  return out;
}

/// Chains of 10, 10 and 20 nodes, end to end, joined weakly.
WeightedGraph three_chains(float first_joint, float second_joint) {
  std::vector<WeightedEdge> edges = chain(0, 40);
  edges[9].weight = first_joint;
  edges[19].weight = second_joint;
  return graph_of(40, edges);
}

TEST(NaturalBorder, IsWhereEdgesAreWeakNotHalfway) {
  EXPECT_EQ(inside(three_chains(0.01f, 1), {{0}, {39}}), numbers(0, 10));
  EXPECT_EQ(inside(three_chains(1, 0.01f), {{0}, {39}}), numbers(0, 20));
}

/// Strips of a surface, 20 wide and 10, 10 and 40 long, end to end, joined weakly: rows of 20 nodes.
WeightedGraph three_strips(float first_joint, float second_joint) {
  return strip({9, first_joint}, {19, second_joint});
}

TEST(NaturalBorder, IsTheOneThatEndsALargerPieceOfTwoAlike) {
  EXPECT_EQ(inside(three_strips(0.01f, 0.01f), {{10}, {1190}}), numbers(0, 400))
      << "as weak a joint, and twice as much behind it";
}

TEST(NaturalBorder, IsTheWeakerOneThoughItEndsASmallerPiece) {
  EXPECT_EQ(inside(three_strips(0.01f, 1), {{10}, {1190}}), numbers(0, 200));
  EXPECT_EQ(inside(three_strips(0.05f, 0.4f), {{10}, {1190}}), numbers(0, 200));
}

TEST(NaturalBorder, IsTheOneThatEndsASmallerPieceWhereThatIsAskedForAndCostsAreAlike) {
  const WeightedGraph alike = three_strips(0.05f, 0.3f), far_weaker = three_strips(0.5f, 0.05f);
  EXPECT_EQ(inside(alike, {{10}, {1190}}), numbers(0, 400));
  EXPECT_EQ(inside(alike, {{10}, {1190}}, {.smallness = 0.2}), numbers(0, 200));
  EXPECT_EQ(inside(far_weaker, {{10}, {1190}}, {.smallness = 0.4}), numbers(0, 400));
  EXPECT_EQ(inside(alike, {{10, 310}, {1190}}, {.smallness = 0.4}), numbers(0, 400)) << "all clicks are inside";
}

TEST(NaturalBorder, OfTheWholeIsNotSoFarOutWhereSmallerPiecesAreAskedFor) {
  const WeightedGraph two = three_strips(0.05f, 0.5f);
  EXPECT_EQ(inside(two, {{10}, {1190}}, {.whole = true}), numbers(0, 400));
  EXPECT_EQ(inside(two, {{10}, {1190}}, {.whole = true, .smallness = 0.4}), numbers(0, 200));
}

TEST(NaturalBorder, IsTheOneBeyondAllThatIsClickedOn) {
  EXPECT_EQ(inside(three_strips(0.05f, 0.1f), {{10, 310}, {1190}}), numbers(0, 400))
      << "who clicks on two pieces means one thing";
}

TEST(NaturalBorder, LeavesPiecesThatAreClickedOnToTheirSide) {
  EXPECT_EQ(inside(three_chains(0.01f, 0.01f), {{0}, {15, 39}}), numbers(0, 10));
  EXPECT_EQ(inside(three_chains(0.01f, 0.01f), {{0, 15}, {39}}), numbers(0, 20));
}

TEST(NaturalBorder, IsHalfwayWhereNothingElseDecides) {
  const std::size_t taken = inside(graph_of(40, chain(0, 40)), {{0}, {39}}).size();
  EXPECT_GE(taken, 18u);
  EXPECT_LE(taken, 22u);
}

TEST(NaturalBorder, AnOutsideClickTakesMoreThanItsOwnNode) {
  // On a grid without any border, a click amid it is not a hole of one node in all the rest.
  constexpr std::uint32_t side = 15;
  const WeightedGraph even = graph_of(side * side, grid(side));
  const std::size_t taken = inside(even, {{side * 7 + 2}, {side * 7 + 12}}).size();
  EXPECT_GT(taken, 70u);
  EXPECT_LT(taken, 155u);
}

TEST(NaturalBorder, OfTheWholeIsTheOneFarthestOutOfThoseNearlyAsWeak) {
  EXPECT_EQ(inside(three_strips(0.05f, 0.06f), {{10}, {1190}}, {.whole = true}), numbers(0, 400));
  EXPECT_EQ(inside(three_strips(0.01f, 0.4f), {{10}, {1190}}, {.whole = true}), numbers(0, 200))
      << "what is joined to more than itself is no whole";
}

TEST(NaturalBorder, OfTheWholeCountsNodesByTheirSize) {
  // A thing of two halves before a wall of few nodes, which are six times as wide: it is no smaller for that.
  WeightedGraph strips = strip({24, 0.2f}, {49, 0.2f});
  EXPECT_EQ(inside(strips, {{10}, {1190}}, {.whole = true}), numbers(0, 500)) << "of nodes alike, the wall is small";
  std::fill(strips.graph.spacing.begin() + 1000, strips.graph.spacing.end(), 6.0f);
  EXPECT_EQ(inside(strips, {{10}, {1190}}, {.whole = true}), numbers(0, 1000));
  EXPECT_EQ(inside(strips, {{10}, {1190}}), numbers(0, 500)) << "where more than one click tells, numbers do";
}

TEST(NaturalBorder, OfTheWholeIsNoCrumbOfNodesAtOnePlace) {
  for (const float spacing : {0.0f, 1e-38f, 1e18f}) {
    WeightedGraph strips = three_strips(0.05f, 0.06f);
    std::fill_n(strips.graph.spacing.begin(), 21, spacing);  // around the click
    EXPECT_EQ(inside(strips, {{10}, {1190}}, {.whole = true}).size() % 200, 0u) << spacing;
    strips = three_strips(0.05f, 0.06f);
    std::fill_n(strips.graph.spacing.begin() + 1100, 21, spacing);  // far off
    EXPECT_EQ(inside(strips, {{10}, {1190}}, {.whole = true}), numbers(0, 400)) << spacing;
  }
}

TEST(NaturalBorder, OfTheWholeIsANumberWhereNodesAreAtOnePlaceOrFarApart) {
  for (const float spacing : {0.0f, 1e-38f, 1e18f}) {
    WeightedGraph strips = three_strips(0.05f, 0.06f);
    std::fill(strips.graph.spacing.begin() + 300, strips.graph.spacing.end(), spacing);
    const auto found = inside(strips, {{10}, {1190}}, {.whole = true});
    EXPECT_GE(found.size(), 1u) << spacing;
    EXPECT_LT(found.size(), 1200u) << spacing;
  }
}

TEST(NaturalBorder, CanBeTakenFartherOutAndIn) {
  const WeightedGraph strips = three_strips(0.05f, 0.4f);
  int wider = 0;
  EXPECT_EQ(inside(strips, {{10}, {1190}}, {}, &wider), numbers(0, 200));
  EXPECT_EQ(inside(strips, {{10}, {1190}}, {.wider = 1}, &wider), numbers(0, 400));
  EXPECT_EQ(wider, 1);
  EXPECT_EQ(inside(three_strips(0.05f, 0.06f), {{10}, {1190}}, {.whole = true, .wider = -1}), numbers(0, 200))
      << "counted from where the whole ends";
}

TEST(NaturalBorder, SaysHowFarItWentWhereThereAreNoMore) {
  int wider = 0;
  const auto farthest = inside(three_strips(0.05f, 0.2f), {{10}, {1190}}, {.wider = 60}, &wider);
  EXPECT_LT(wider, 60);
  EXPECT_GE(wider, 1);
  EXPECT_EQ(inside(three_strips(0.05f, 0.2f), {{10}, {1190}}, {.wider = wider}), farthest);
  const auto inmost = inside(three_strips(0.05f, 0.2f), {{10}, {1190}}, {.wider = -60}, &wider);
  EXPECT_LE(wider, 0);
  EXPECT_GE(inmost.size(), 1u);
  EXPECT_LE(inmost.size(), 200u);
}

TEST(NaturalBorder, SaysOnWhichSidesThereAreOthers) {
  const WeightedGraph strips = three_strips(0.05f, 0.2f);
  std::vector<Given> given(strips.graph.size(), Given::no);
  given[10] = Given::inside;
  given[1190] = Given::outside;
  const std::vector<double> potential = random_walk(strips.graph, strips.weight, given);
  const auto at = [&](int wider) {
    return natural_border(strips.graph, strips.weight, potential, given, {{10}, {1190}}, {.wider = wider});
  };
  const int first = at(-60).wider, last = at(60).wider;
  ASSERT_LT(first, last);
  for (int wider = first; wider <= last; ++wider) {
    EXPECT_EQ(at(wider).more, wider < last) << wider;
    EXPECT_EQ(at(wider).less, wider > first) << wider;
  }
}

TEST(NaturalBorder, IsCountedFromWhatIsInsideAlreadyWhereThatIsAsked) {
  const WeightedGraph strips = three_strips(0.05f, 0.4f);
  std::vector<Given> given(strips.graph.size(), Given::no);
  std::fill_n(given.begin(), 200, Given::inside);
  given[1190] = Given::outside;
  const std::vector<double> potential = random_walk(strips.graph, strips.weight, given);
  const auto taken = [&](int wider) {
    return natural_border(strips.graph, strips.weight, potential, given, {{10}, {1190}},
                          {.wider = wider, .beyond = true});
  };
  const auto count = [](const NaturalBorder& border) {
    return std::count(border.inside.begin(), border.inside.end(), 1);
  };
  EXPECT_EQ(count(taken(0)), 200);
  EXPECT_GT(count(taken(1)), 1.15 * 200);
  EXPECT_EQ(taken(1).wider, 1);
  EXPECT_LT(taken(60).wider, 60);
  EXPECT_TRUE(taken(0).more);
  EXPECT_FALSE(taken(0).less) << "nothing is known of what was before";
  EXPECT_TRUE(taken(1).less) << "what was given is farther in";
  EXPECT_FALSE(taken(60).more);
}

TEST(NaturalBorder, BeyondWhatIsInsideIsAllThatCanBeReachedWhereNothingIsOutside) {
  const WeightedGraph strips = three_strips(0.05f, 0.4f);
  std::vector<Given> given(strips.graph.size(), Given::no);
  std::fill_n(given.begin(), 200, Given::inside);
  const std::vector<double> potential = random_walk(strips.graph, strips.weight, given);
  const auto taken = [&](int wider) {
    return natural_border(strips.graph, strips.weight, potential, given, {{10}, {}}, {.wider = wider, .beyond = true});
  };
  EXPECT_EQ(std::ranges::count(taken(0).inside, 1), 200);
  EXPECT_TRUE(taken(0).more && !taken(0).less);
  EXPECT_EQ(std::ranges::count(taken(2).inside, 1), 1200);
  EXPECT_EQ(taken(2).wider, 1);
  EXPECT_TRUE(!taken(2).more && taken(2).less);
}

TEST(BorderRatio, IsWhatLeavesByTheRootOfWhatIsLess) {
  const WeightedGraph strips = three_strips(0.01f, 1);
  const auto ratio_of = [&](std::uint32_t nodes) {
    std::vector<std::uint8_t> inside(strips.graph.size(), 0);
    std::fill_n(inside.begin(), nodes, std::uint8_t{1});
    return border_ratio(strips.graph, strips.weight, inside);
  };
  // Ten rows of 20 hold 190 edges along them and 180 across, both ways, and end at 20 of a hundredth.
  EXPECT_NEAR(ratio_of(200), (8 + 0.2) / std::sqrt(2.0 * (190 + 180) + 0.2), 1e-6);
  EXPECT_GT(ratio_of(220), 2 * ratio_of(200)) << "beyond the joint";
  EXPECT_NEAR(ratio_of(1000), (8 + 20) / std::sqrt(2.0 * (190 + 180) + 20), 1e-6) << "the lesser part is outside";
  EXPECT_EQ(ratio_of(0), 0);
  const double all = 2.0 * (60 * 19 + 59 * 20) - 2 * 20 * 0.99;
  EXPECT_NEAR(ratio_of(1200), 8 / std::sqrt(all), 1e-6) << "all there is is a thing that stands alone";
}

TEST(NaturalBorder, TakesAllThatCanBeReachedWhereNothingIsOutside) {
  std::vector<WeightedEdge> edges = chain(0, 5);
  for (const WeightedEdge& edge : chain(5, 9)) edges.push_back(edge);
  EXPECT_EQ(inside(graph_of(9, edges), {{1}, {}}), numbers(0, 5));
  EXPECT_EQ(inside(graph_of(1, {}), {{0}, {}}), numbers(0, 1));
}

}  // namespace
}  // namespace engine::select
