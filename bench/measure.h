// What the benchmarks share: clocks, medians, and how figures of another machine carry over to this one.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <vector>

#include "bench/calibrator.h"

namespace bench {

using Clock = std::chrono::steady_clock;

inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

inline double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + std::ptrdiff_t(values.size() / 2), values.end());
  return values[values.size() / 2];
}

/// Pairs per second that the calibrator makes now, on all threads of the arena.
inline double calibrator_pairs_per_s() {
  const auto start = Clock::now();
  const auto pairs = double(blend_in_registers(300'000));
  return pairs / seconds_since(start);
}

/// OpenSplat's rasteriser on fox, view 0001, 359x640, two threads (middle of 7 to 9 runs; measured once, elsewhere).
constexpr double peer_forward_s = 0.590;
constexpr double peer_forward_and_backward_s = 0.847;  // to all groups of parameters, without loss or optimiser
/// What the calibrator's arithmetic ran at on that machine's two cores.
constexpr double peer_calibrator_pairs_per_s = 2 * 2.6e9;

/// How many times as fast as the peer would be on this machine.
inline double times_faster(double peer_s, double s, double pairs_per_s) {
  return peer_s * peer_calibrator_pairs_per_s / pairs_per_s / s;
}

}  // namespace bench
