// The value in the middle.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace engine {

/// The median; of an even number of values the upper of the two in the middle. Precondition: at least one, none NaN.
template <class T>
[[nodiscard]] T median(std::vector<T> values) {
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace engine
