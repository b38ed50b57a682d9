// Random numbers of a training: named by what they are for, so that no draw depends on another one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "engine/core/rng.h"

namespace engine::train {

/// The name of a correction's random numbers.
struct RandomKey {
  std::uint64_t seed = 0;  ///< Random seed of the edit or fit.
  int interval = 0;        ///< 0 to 255
  int correction = 0;      ///< Correction within the interval, 0 to 255.
};

/// What a stream is for: the order of views, the positions of children, or those that a fit begins with.
enum class Purpose : std::uint8_t { order, split, start };

/// The stream for a purpose at an iteration (below 2^32).
inline Rng stream(const RandomKey& key, Purpose purpose, std::size_t iteration) {
  return Rng(key.seed, std::uint64_t{1} << 63 | std::uint64_t(purpose) << 48 | std::uint64_t(key.interval & 255) << 40 |
                           std::uint64_t(key.correction & 255) << 32 | std::uint64_t(iteration & 0xffffffffu));
}

/// 0 to count - 1 in random order (Fisher and Yates): the views of an epoch, which is named by its first iteration.
inline std::vector<std::uint32_t> shuffled(std::size_t count, const RandomKey& key, std::size_t first_iteration) {
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  Rng rng = stream(key, Purpose::order, first_iteration);
  for (std::size_t i = count; i > 1; --i) std::swap(order[i - 1], order[rng.below(std::uint32_t(i))]);
  return order;
}

}  // namespace engine::train
