// How firmly a part hangs on to what is around it.
#pragma once

#include <cstdint>
#include <span>

#include "engine/neighbours/neighbour_graph.h"

namespace engine::select {

/// How much neighbours across the weakest border of a part are alike, in the mean, from 0: nothing joins the part to
/// the rest. The border that is looked for keeps at least half of the part: what of its surroundings was selected with
/// a thing, such as a rim of table, does not hold it. Borders are the level sets of a random walk from the inmost nodes
/// of the part to the rest.
///   alike    [edges] 0 or more, the same both ways
///   is_part  [nodes] 1: of the part; the others are the rest
///   returns  0 where there is no rest, or no part
/// Source: as natural_border.h.
[[nodiscard]] double firmness(const neighbours::NeighbourGraph& graph, std::span<const float> alike,
                              std::span<const std::uint8_t> is_part);

}  // namespace engine::select
