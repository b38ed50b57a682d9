// Where a walk along the edges of a graph ends.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/neighbours/neighbour_graph.h"

namespace engine::select {

/// Whether a node is given, and for which side.
enum class Given : std::uint8_t { no, inside, outside };

/// The least weight of an edge worth walking on. Across the sharpest border some of a walk goes on: else pieces of one
/// thing that hardly touch would have nothing to do with each other, and the solver no end. Chosen on the captured
/// cases mug, turn, plant and rod: 1e-4 gives the same where both converge, and takes three times as many steps.
inline constexpr float least_weight = 1e-3f;

/// For each node how likely a random walk that begins there comes to a node that is given for the inside before it
/// comes to one that is given for the outside: 1 at the former, 0 at the latter and where there is no way to either.
/// At each node the walk takes one of its edges, each as likely as it has weight.
///   weight   [edges] 0 or more, the same both ways
///   given    [nodes]
///   leak     [nodes] 0 or more: the weight of an edge more of each node, by which a walk ends outside. Empty: none
///   returns  [nodes] 0 to 1, to about four digits. The same bytes for any number of threads.
/// Source: Grady 2006, "Random walks for image segmentation", section III: the combinatorial Dirichlet problem. Solved
/// by conjugate gradients, preconditioned by graphs of merged nodes (Notay 2010, "An aggregation-based algebraic
/// multigrid method"), in about as many steps for any graph.
[[nodiscard]] std::vector<double> random_walk(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
                                              std::span<const Given> given, std::span<const float> leak = {});

}  // namespace engine::select
