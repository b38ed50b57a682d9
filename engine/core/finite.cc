#include "engine/core/finite.h"

#include <bit>
#include <cstdint>

namespace engine {
namespace {

constexpr std::uint32_t exponent_mask = 0x7f800000u;  // all ones here: NaN or infinity

bool not_finite(float value) noexcept { return (std::bit_cast<std::uint32_t>(value) & exponent_mask) == exponent_mask; }

}  // namespace

std::optional<std::size_t> first_not_finite(std::span<const float> values) noexcept {
  constexpr std::size_t block = 64;  // branch once per block, so that the common case vectorises
  for (std::size_t begin = 0; begin < values.size(); begin += block) {
    const std::size_t end = begin + block < values.size() ? begin + block : values.size();
    bool bad = false;
    for (std::size_t i = begin; i < end; ++i) bad |= not_finite(values[i]);
    if (!bad) continue;
    for (std::size_t i = begin; i < end; ++i)
      if (not_finite(values[i])) return i;
  }
  return std::nullopt;
}

}  // namespace engine
