// Pictures and masks for the tests of this room.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>

#include "engine/core/rng.h"
#include "engine/scene/image.h"

namespace engine::correct {

/// color(x, y, channel) at each pixel.
inline scene::Image painted(int width, int height, const std::function<float(int, int, int)>& color, int channels = 3) {
  scene::Image image(width, height, channels);
  for (int c = 0; c < channels; ++c)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) image.at(x, y, c) = color(x, y, c);
  return image;
}

inline scene::Image noise(int width, int height, std::uint64_t seed, int channels = 3) {
  Rng rng(seed);
  return painted(
      width, height, [&](int, int, int) { return rng.uniform(); }, channels);
}

/// Slanting stripes, each 6 pixels wide along a row.
inline scene::Image stripes(int width, int height, int shift = 0) {
  return painted(width, height, [shift](int x, int y, int c) {
    return float(0.5 + (0.3 - 0.2 * c) * std::sin(0.5235987755982988 * (x + y + shift)));
  });
}

inline scene::Mask all_set(int width, int height) {
  scene::Mask mask(width, height);
  for (std::uint8_t& flag : mask.data) flag = 1;
  return mask;
}

inline scene::Mask box_mask(int width, int height, scene::Rect box) {
  scene::Mask mask(width, height);
  for (int y = box.y0; y < box.y1; ++y)
    for (int x = box.x0; x < box.x1; ++x) mask.at(x, y) = 1;
  return mask;
}

/// `image` with one colour where the mask is set.
inline scene::Image spoilt(scene::Image image, const scene::Mask& mask, float value) {
  for (int c = 0; c < image.channels; ++c)
    for (std::size_t i = 0; i < mask.data.size(); ++i)
      if (mask.data[i] != 0) image.plane(c)[i] = value;
  return image;
}

/// PSNR over the pixels of the mask.
inline double psnr_in(const scene::Image& a, const scene::Image& b, const scene::Mask& mask) {
  double sum = 0, count = 0;
  for (int c = 0; c < a.channels; ++c)
    for (std::size_t i = 0; i < mask.data.size(); ++i)
      if (mask.data[i] != 0) sum += std::pow(double(a.plane(c)[i]) - double(b.plane(c)[i]), 2), ++count;
  return sum == 0 ? std::numeric_limits<double>::infinity() : -10 * std::log10(sum / count);
}

/// The largest difference of two pictures of the same shape; NaN if there is one.
inline double largest_difference(const scene::Image& a, const scene::Image& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    const double difference = std::abs(double(a.data[i]) - double(b.data[i]));
    if (!(difference <= most)) most = difference;
  }
  return most;
}

}  // namespace engine::correct
