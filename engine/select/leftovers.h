// What a border cuts off a thing, or leaves out of it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/neighbours/neighbour_graph.h"
#include "engine/select/random_walk.h"

namespace engine::select {

/// Takes in the leftovers of a thing: a leg of a chair that was cut off, the bare foot of a printed can. The border
/// that is the weakest as a whole may cut there, where a thing is thin or its colours change. A piece of what is
/// outside is a leftover where it
/// - is joined to what is inside by more than half the weight that joins it to the rest;
/// - is joined to the rest weakly, edge by edge: where a surface goes on, it is not cut anew farther out;
/// - has at most 0.15 times as many nodes as there were inside, each of them;
/// - is next to no node that was clicked on as outside.
/// Pieces are looked for among the nodes from which a walk ends inside with more than 0.9, then 0.8, ... 0.1, before it
/// ends outside or dies: the leg by itself first, and only later together with the carpet that it stands on.
///   weight   [edges] 0 or more, the same both ways
///   given    [nodes] What is given for the outside stays there.
///   clicked  nodes that were clicked on as outside
///   inside   [nodes] 1: inside. Only ever gains. The same for any number of threads
/// Source: ours (docs/adr/0044-leftovers.md).
void take_leftovers(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
                    std::span<const Given> given, std::span<const std::uint32_t> clicked,
                    std::vector<std::uint8_t>& inside);

}  // namespace engine::select
