// What all messages of the wire share: points, and the limits of what is read.
#pragma once

#include <array>
#include <cstddef>

#include "engine/core/result.h"

namespace proto {

using engine::Result;

using Point = std::array<double, 3>;  ///< World units, the file's own frame.

// Limits of what is read. All are choices: far above what people send, far below what would hurt.
constexpr std::size_t max_text_bytes = 4096;  ///< Length of a prompt or a name.
constexpr double max_coordinate = 1e12;       ///< Absolute value, world units.

/// What a JSON document may be; checked while it is read, before memory grows with it.
struct JsonLimits {
  std::size_t max_bytes = std::size_t{1} << 20;
  int max_depth = 16;  ///< Arrays and objects within one another.
};

}  // namespace proto
