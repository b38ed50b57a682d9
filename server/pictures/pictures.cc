#include "server/pictures/pictures.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace server::pictures {

using engine::scene::Image;
using engine::scene::Mask;

Image with_mask_shown(const Image& picture, const Mask& mask) {
  Image tinted = picture;
  for (int c = 0; c < tinted.channels; ++c) {
    const auto plane = tinted.plane(c);
    for (std::size_t i = 0; i < plane.size(); ++i)
      if (mask.data[i] != 0) plane[i] += tint_share * (tint_color[c] - plane[i]);
  }
  return tinted;
}

double psnr_outside(const Image& a, const Image& b, const Mask& mask) {
  double sum = 0;
  std::size_t count = 0;
  for (int c = 0; c < a.channels; ++c) {
    const auto plane_a = a.plane(c), plane_b = b.plane(c);
    for (std::size_t i = 0; i < plane_a.size(); ++i) {
      if (mask.data[i] != 0) continue;
      const double difference = double(plane_a[i]) - double(plane_b[i]);
      sum += difference * difference;
      ++count;
    }
  }
  if (sum == 0) return std::numeric_limits<double>::infinity();
  return -10 * std::log10(sum / double(count));
}

Image clamped(Image picture) {
  for (float& value : picture.data) value = std::clamp(value, 0.0f, 1.0f);
  return picture;
}

Image mean_depth(const Image& depth, const Image& alpha) {
  Image mean = depth;
  for (std::size_t i = 0; i < mean.data.size(); ++i)
    mean.data[i] = alpha.data[i] < 1.0f / 255 ? 0.0f : depth.data[i] / alpha.data[i];
  return mean;
}

Image shaded_depth(const Image& mean_depth) {
  float nearest = std::numeric_limits<float>::infinity(), farthest = 0;
  for (const float z : mean_depth.data) {
    if (z <= 0) continue;
    nearest = std::min(nearest, z);
    farthest = std::max(farthest, z);
  }
  constexpr float darkest = 0.1f;  // of 0..1, so that the farthest point differs from nothing; a choice
  const float range = std::max(farthest - nearest, 1e-6f * std::abs(farthest));  // a wall seen head-on has no range
  Image shades = mean_depth;
  for (float& z : shades.data) z = z <= 0 ? 0.0f : 1.0f - (1.0f - darkest) * (z - nearest) / range;
  return shades;
}

}  // namespace server::pictures
