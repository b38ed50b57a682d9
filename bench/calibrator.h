// How fast this machine blends when nothing but arithmetic stands in the way.
#pragma once

#include <cstdint>

namespace bench {

/// Blends `steps` times a few vectors of pixels that live in registers, on every thread of the arena: the exponential,
/// the 0.99 clamp, the 1/255 test, three colour sums and the transmittance. No memory, no sorting, no early end.
/// Returns how many pixel-Gaussian pairs that were. Timings of a renderer divided by this loop's carry over between
/// machines.
std::uint64_t blend_in_registers(std::uint64_t steps);

}  // namespace bench
