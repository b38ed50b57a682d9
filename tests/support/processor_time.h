// How much of the processor something takes.
#pragma once

#include <algorithm>
#include <ctime>
#include <limits>

namespace support {

/// Seconds of the processor that this process takes for work(), the least of so many times: other work on the machine
/// is none of it, and what is done once, as threads that start, counts only where it is asked for once.
template <class Work>
double processor_seconds(Work&& work, int times = 1) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < times; ++i) {
    const std::clock_t begin = std::clock();
    work();
    least = std::min(least, double(std::clock() - begin) / CLOCKS_PER_SEC);
  }
  return least;
}

}  // namespace support
