// Pictures for the tests of losses.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/core/rng.h"
#include "engine/optim/losses_reference.h"
#include "engine/scene/image.h"

namespace engine::optim {

/// Noise in [low, high).
inline scene::Image noise(int width, int height, std::uint64_t seed, float low = 0, float high = 1, int channels = 3) {
  scene::Image image(width, height, channels);
  Rng rng(seed);
  for (float& value : image.data) value = rng.uniform(low, high);
  return image;
}

/// `image` with noise of the given size on the pixels of `rect`.
inline scene::Image disturbed(const scene::Image& image, scene::Rect rect, float size, std::uint64_t seed) {
  scene::Image out = image;
  Rng rng(seed);
  for (int c = 0; c < image.channels; ++c)
    for (int y = rect.y0; y < rect.y1; ++y)
      for (int x = rect.x0; x < rect.x1; ++x) out.at(x, y, c) += rng.uniform(-size, size);
  return out;
}
inline scene::Image disturbed(const scene::Image& image, float size, std::uint64_t seed) {
  return disturbed(image, {0, 0, image.width, image.height}, size, seed);
}

/// Waves: neighbours are alike, as in photographs.
inline scene::Image waves(int width, int height, double phase = 0) {
  scene::Image image(width, height, 3);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        image.at(x, y, c) =
            float(0.5 + 0.3 * std::sin(0.21 * x + 0.13 * y * (c + 1) + phase) + 0.1 * std::cos(1.1 * y));
  return image;
}

/// About one pixel in `rarity` set.
inline scene::Mask scattered_mask(int width, int height, std::uint32_t rarity, std::uint64_t seed) {
  scene::Mask mask(width, height);
  Rng rng(seed);
  for (auto& pixel : mask.data) pixel = rng.below(rarity) == 0 ? 1 : 0;
  return mask;
}

template <std::floating_point Real>
reference::Plane<Real> plane_of(const scene::Image& image, int c) {
  reference::Plane<Real> plane(image.width, image.height);
  const auto values = image.plane(c);
  plane.data.assign(values.begin(), values.end());
  return plane;
}

/// |a - b| / |b| in the Euclidean norm.
template <class A, class B>
double relative_error(const A& a, const B& b) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    difference += std::pow(double(a[i]) - double(b[i]), 2);
    size += std::pow(double(b[i]), 2);
  }
  return std::sqrt(difference / size);
}

}  // namespace engine::optim
