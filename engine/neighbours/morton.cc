#include "engine/neighbours/morton.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>

namespace engine::neighbours {
namespace {

constexpr double cells = 1024;  // along each axis: three times ten bits

/// Ten bits, each followed by two zeros.
std::uint32_t spread_out(std::uint32_t x) {
  x = (x | x << 16) & 0x030000ff;
  x = (x | x << 8) & 0x0300f00f;
  x = (x | x << 4) & 0x030c30c3;
  return (x | x << 2) & 0x09249249;
}

}  // namespace

std::vector<std::uint32_t> morton_order(std::span<const float> points) {
  assert(points.size() % 3 == 0);
  const std::size_t n = points.size() / 3;
  std::array<double, 3> low{}, scale{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    float least = n > 0 ? points[axis] : 0, most = least;
    for (std::size_t i = 0; i < n; ++i) {
      least = std::min(least, points[3 * i + axis]);
      most = std::max(most, points[3 * i + axis]);
    }
    const double length = double(most) - double(least);  // of doubles: no two floats are too far apart
    low[axis] = double(least);
    scale[axis] = length > 0 ? cells / length : 0.0;  // all in one plane: one cell
  }
  std::vector<std::uint64_t> keys(n);  // cell first, then index
  for (std::size_t i = 0; i < n; ++i) {
    std::uint32_t cell = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double at = (double(points[3 * i + axis]) - low[axis]) * scale[axis];
      cell |= spread_out(std::uint32_t(std::min(at, cells - 1))) << axis;
    }
    keys[i] = std::uint64_t(cell) << 32 | i;
  }
  std::sort(keys.begin(), keys.end());
  std::vector<std::uint32_t> order(n);
  for (std::size_t i = 0; i < n; ++i) order[i] = std::uint32_t(keys[i]);
  return order;
}

}  // namespace engine::neighbours
