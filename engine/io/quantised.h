// Small conversions between stored values and the bytes of the compact formats.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>

#include "engine/core/vec.h"
#include "engine/scene/opacity.h"
#include "engine/scene/sh.h"

namespace engine::io {

using scene::sh_c0;

/// Log scales are written within this, either way: beyond it the engine saturates, and exp() would be infinite some
/// day.
constexpr float most_log_scale = 20.0f;

/// What a format has room for: `low` and `high` are the least and the greatest value that a file can say.
struct StoredRange {
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
  double step = 0;  ///< Between values next to each other; 0: floats.
  /// Whether the value is but rounded to what a file can say. Half a step beyond the ends is: so far apart are values
  /// and what becomes of them in between, too.
  [[nodiscard]] constexpr bool holds(double value) const { return value >= low - step / 2 && value <= high + step / 2; }
};

/// Of log scales that are floats, or between ends that are.
constexpr StoredRange saturated_log_scales{-double(most_log_scale), double(most_log_scale), 0};

/// Nearest byte, saturating.
inline std::uint8_t nearest_byte(double value) { return std::uint8_t(std::clamp(std::round(value), 0.0, 255.0)); }

/// The logit of opacity u / 255. 0 and 255 would be infinite; they are taken as a quarter step inside, logit -6.93 and
/// 6.93: an opacity of 0.001 is still below the 1/255 that is drawn, and both come back as the byte they were.
inline float logit_of_byte(std::uint8_t u) { return float(scene::logit(std::clamp(double(u), 0.25, 254.75) / 255.0)); }

inline std::uint8_t byte_of_logit(float logit) { return nearest_byte(255.0 / (1.0 + std::exp(-double(logit)))); }

/// A rotation as its three smallest components: what the largest one is, the unit length says.
struct SmallestThree {
  std::size_t largest = 0;  ///< Which is left out, of (w, x, y, z).
  std::array<double, 3>
      rest{};  ///< The others in order, 0 to 1 for -1/sqrt(2) to 1/sqrt(2), the largest being positive.
};
/// Of a rotation of any length; of (0, 0, 0, 0), which is none, the identity.
inline SmallestThree smallest_three(Quat rotation) {
  std::array<double, 4> q = {rotation.w, rotation.x, rotation.y, rotation.z};
  double square = 0;
  for (const double c : q) square += c * c;
  if (square == 0) q = {square = 1, 0, 0, 0};
  SmallestThree out;
  for (std::size_t c = 1; c < 4; ++c)
    if (std::abs(q[c]) > std::abs(q[out.largest])) out.largest = c;
  const double scale = (q[out.largest] < 0 ? -1.0 : 1.0) / std::sqrt(square);
  std::size_t next = 0;
  for (std::size_t c = 0; c < 4; ++c)
    if (c != out.largest) out.rest[next++] = q[c] * scale / std::numbers::sqrt2 + 0.5;
  return out;
}

/// A packed rotation that gives itself again when it is unpacked and packed, so that a scene that was read and is
/// written again has the same bytes. Where two components are nearly the largest, or none of the four is left out,
/// rounding may make a neighbour of it; then the neighbour is taken, or the lower one of two that give each other.
///   pack    bytes or a word of a rotation;  unpack: a rotation of them
template <class Pack, class Unpack>
auto stable_rotation(Quat rotation, Pack&& pack, Unpack&& unpack) {
  constexpr int most_tries = 16;
  auto packed = pack(rotation);
  auto before = packed;
  for (int tries = 0; tries < most_tries; ++tries) {
    const auto again = pack(unpack(packed));
    if (again == packed) return packed;
    if (again == before) return std::min(again, packed);
    before = packed, packed = again;
  }
  return packed;
}

}  // namespace engine::io
