// Relaxes a function on a grid towards the one that bends least, node by node.
#pragma once

#include <cstdint>
#include <span>

#include "engine/repair/thin_plate.h"

namespace engine::repair {

/// Successive over-relaxation (Young 1954): sets each free node to what is least for it alone, and a little beyond,
/// `sweeps` times, colour by colour. Only second differences between free nodes count. The same bits for any number of
/// threads and any instruction set.
/// Precondition: fewer than 2^31 nodes, and spans of just as many (asserted).
///   known    [nodes]
///   is_free  [nodes] Those that are relaxed
///   pull     weight of squared differences from what is known, beside that of bending
///   values   [nodes] Finite. In: what is known, where nothing is a first guess, within the bounds
void relax(const GridSize& size, std::span<const Knowledge> known, std::span<const std::uint8_t> is_free, float pull,
           int sweeps, std::span<float> values);

}  // namespace engine::repair
