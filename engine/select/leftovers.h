// What a border cuts off a thing, or leaves out of it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/neighbours/neighbour_graph.h"
#include "engine/select/random_walk.h"

namespace engine::select {

/// Takes in the leftovers of a thing: a leg of a chair that was cut off, the bare foot of a printed can. The border
/// that is the weakest as a whole may cut there, where a thing is thin, or its colours change; but what is left hangs
/// on by what is inside at least nearly as firmly as by all the rest, and it is little. Looked for among the pieces of
/// all from where a walk rather ends inside than it dies, at falling levels: so that a leg comes off the carpet that it
/// stands on.
///   weight   [edges] 0 or more, the same both ways
///   given    [nodes] What is given for the outside stays there.
///   clicked  nodes that were clicked on as outside: what is next to one stays with it
///   inside   [nodes] 1: inside. Only ever gains. The same for any number of threads
void take_leftovers(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
                    std::span<const Given> given, std::span<const std::uint32_t> clicked,
                    std::vector<std::uint8_t>& inside);

}  // namespace engine::select
