#include "engine/select/firmness.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/engine/select/weighted_graphs.h"

namespace engine::select {
namespace {

/// A strip of 60 rows of 20 nodes, joined by these weights between rows 19 and 20 and between rows 29 and 30.
WeightedGraph joined_strip(float at_20, float at_30) {
  WeightedGraph out = strip({19, at_20}, {29, at_30});
  out.graph.length.assign(out.graph.to.size(), 1.0f);
  return out;
}

/// The first rows of the strip.
std::vector<std::uint8_t> first_rows(const WeightedGraph& on, std::size_t rows) {
  std::vector<std::uint8_t> out(on.graph.size(), 0);
  for (std::size_t node = 0; node < rows * 20; ++node) out[node] = 1;
  return out;
}

TEST(Firmness, IsOneAcrossASurfaceThatGoesOn) {
  const WeightedGraph on = joined_strip(1, 1);
  EXPECT_NEAR(firmness(on.graph, on.weight, first_rows(on, 20)), 1, 1e-6);
}

TEST(Firmness, IsThatOfTheBorderWhereThePartEnds) {
  const WeightedGraph on = joined_strip(0.05f, 1);
  EXPECT_NEAR(firmness(on.graph, on.weight, first_rows(on, 20)), 0.05, 1e-6);
}

TEST(Firmness, IsThatOfAWeakerBorderWithinThePart) {
  const WeightedGraph on = joined_strip(0.05f, 1);
  EXPECT_NEAR(firmness(on.graph, on.weight, first_rows(on, 30)), 0.05, 1e-6) << "with a rim of what it stands on";
}

TEST(Firmness, DoesNotLookForBordersThatKeepLessThanHalf) {
  const WeightedGraph on = joined_strip(0.05f, 0.5f);
  EXPECT_NEAR(firmness(on.graph, on.weight, first_rows(on, 30)), 0.05, 1e-6);
  EXPECT_NEAR(firmness(on.graph, on.weight, first_rows(on, 50)), 0.5, 1e-6) << "20 of 50 are less than half";
}

TEST(Firmness, IsNothingWithoutARestOrAPartOrAWay) {
  WeightedGraph on = joined_strip(1, 1);
  EXPECT_EQ(firmness(on.graph, on.weight, first_rows(on, 60)), 0);
  EXPECT_EQ(firmness(on.graph, on.weight, first_rows(on, 0)), 0);
  const WeightedGraph apart = joined_strip(0, 1);
  EXPECT_EQ(firmness(apart.graph, apart.weight, first_rows(apart, 20)), 0);
  // Beyond a gap that nothing spans, neighbours are not next to each other.
  for (std::uint32_t node = 0; node < on.graph.size(); ++node)
    for (std::uint32_t edge = on.graph.begin[node]; edge < on.graph.begin[node + 1]; ++edge)
      if ((node < 400) != (on.graph.to[edge] < 400)) on.graph.length[edge] = 5;
  EXPECT_EQ(firmness(on.graph, on.weight, first_rows(on, 20)), 0);
}

TEST(Firmness, OfASingleNodeIsThatOfItsEdges) {
  const WeightedGraph on = joined_strip(1, 1);
  std::vector<std::uint8_t> one(on.graph.size(), 0);
  one[210] = 1;
  EXPECT_NEAR(firmness(on.graph, on.weight, one), 1, 1e-6);
}

}  // namespace
}  // namespace engine::select
