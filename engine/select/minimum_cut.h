// The cheapest way to cut a graph in two. The one place that knows Boost.Graph.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "engine/select/neighbour_graph.h"

namespace engine::select {

// A pull that nothing outweighs.
constexpr std::int32_t certainly_inside = std::numeric_limits<std::int32_t>::max();
constexpr std::int32_t certainly_outside = -certainly_inside;

/// Puts each node inside or outside so that the sum of the capacities of edges between the two, and of the pulls that
/// are not followed, is least. In whole numbers, on one thread: the same everywhere. Where several cuts are equally
/// cheap, the one with the fewest nodes inside.
///   capacity  [edges] 0 or more, the same both ways; their sum fits 62 bits
///   pull      [nodes] above 0: towards inside; below: towards outside
///   returns   [nodes] 1: inside
/// Source: Boykov and Kolmogorov 2004, "An experimental comparison of min-cut/max-flow algorithms".
[[nodiscard]] std::vector<std::uint8_t> minimum_cut(const NeighbourGraph& graph, std::span<const std::int32_t> capacity,
                                                    std::span<const std::int32_t> pull);

}  // namespace engine::select
