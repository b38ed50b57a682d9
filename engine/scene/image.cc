#include "engine/scene/image.h"

#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>

namespace engine::scene {

std::size_t Mask::area() const {
  return std::accumulate(data.begin(), data.end(), std::size_t{0});
}

double psnr(const Image& a, const Image& b) {
  assert(a.width == b.width && a.height == b.height && a.channels == b.channels && !a.data.empty());
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    const double difference = double(a.data[i]) - double(b.data[i]);
    sum += difference * difference;
  }
  if (sum == 0) return std::numeric_limits<double>::infinity();
  return -10.0 * std::log10(sum / double(a.data.size()));
}

}  // namespace engine::scene
