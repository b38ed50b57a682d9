// Sums over windows of a picture, each in the time of four reads.
// Source: Crow 1984, "Summed-area tables for texture mapping".
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace engine::scene {

/// Sums over square windows of the values of a picture, in double.
class WindowSums {
 public:
  WindowSums(int width, int height)
      : width_(width), height_(height), sums_(std::size_t(width + 1) * std::size_t(height + 1), 0.0) {}

  /// In the order of rows, each from the left.
  void add(int x, int y, double value) { at(x + 1, y + 1) = value + at(x, y + 1) + at(x + 1, y) - at(x, y); }

  /// Over the pixels within `radius` of one, as far as they are in the picture. A difference of sums, which rounds.
  [[nodiscard]] double around(int x, int y, int radius) const {
    const int x0 = std::max(x - radius, 0), x1 = std::min(x + radius + 1, width_);
    const int y0 = std::max(y - radius, 0), y1 = std::min(y + radius + 1, height_);
    return at(x1, y1) - at(x0, y1) - at(x1, y0) + at(x0, y0);
  }
  /// The same divided by the number of those pixels.
  [[nodiscard]] double mean_around(int x, int y, int radius) const {
    const int columns = std::min(x + radius + 1, width_) - std::max(x - radius, 0);
    const int rows = std::min(y + radius + 1, height_) - std::max(y - radius, 0);
    return around(x, y, radius) / (double(columns) * double(rows));
  }

 private:
  [[nodiscard]] double& at(int x, int y) { return sums_[std::size_t(y) * std::size_t(width_ + 1) + std::size_t(x)]; }
  [[nodiscard]] double at(int x, int y) const {
    return sums_[std::size_t(y) * std::size_t(width_ + 1) + std::size_t(x)];
  }

  int width_, height_;
  std::vector<double> sums_;  ///< Over all pixels above and to the left.
};

}  // namespace engine::scene
