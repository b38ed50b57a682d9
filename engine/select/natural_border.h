// Where a thing ends: the border across which hardly anything is joined.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/neighbours/neighbour_graph.h"
#include "engine/select/random_walk.h"

namespace engine::select {

/// Nodes that were clicked on, one per click.
struct ClickedNodes {
  std::vector<std::uint32_t> inside, outside;
};

/// Divides the graph at a level of the potentials: nodes at or above it are inside. Of all levels the one where the
/// pieces that the clicks are on, inside and outside, are joined to the rest most weakly: on either side, the sum, over
/// the clicks, of a piece's border ratio, times the number of these pieces. The border ratio is the weight of the edges
/// that leave a piece, and a few more, by the root of that of all its nodes' edges or of all others', whichever is
/// less. On a surface, a border grows as the root of what it encloses: so neither large pieces are preferred nor small
/// ones, as they are by conductance, which divides by the weight itself. Where there are clicks on both sides, levels
/// near one half are preferred a little: it decides where nothing else does. Where nothing is given for the outside,
/// all that can be reached is inside.
///   weight     [edges] 0 or more, the same both ways
///   potential  [nodes] of random_walk()
///   given      [nodes]; clicked nodes are given for their side
///   returns    [nodes] 1: inside
/// Source: sweeps over level sets, Andersen, Chung and Lang 2006, "Local graph partitioning using PageRank vectors";
/// the ratio, and that outside pieces count alike, are ours.
[[nodiscard]] std::vector<std::uint8_t> natural_border(const neighbours::NeighbourGraph& graph,
                                                       std::span<const float> weight, std::span<const double> potential,
                                                       std::span<const Given> given, const ClickedNodes& clicked);

}  // namespace engine::select
