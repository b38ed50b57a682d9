#include "engine/scene/image.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>

namespace engine::scene {

std::size_t Mask::area() const { return std::accumulate(data.begin(), data.end(), std::size_t{0}); }

Image cut_out(const Image& image, Rect part) {
  assert(part.x0 >= 0 && part.y0 >= 0 && part.x1 <= image.width && part.y1 <= image.height);
  Image out(part.width(), part.height(), image.channels);
  for (int c = 0; c < image.channels; ++c)
    for (int y = 0; y < out.height; ++y)
      std::copy_n(image.plane(c).data() + std::ptrdiff_t(part.y0 + y) * image.width + part.x0, out.width,
                  out.plane(c).data() + std::ptrdiff_t(y) * out.width);
  return out;
}

void paste(const Image& image, Rect part, Image& to) {
  assert(part.x0 >= 0 && part.y0 >= 0 && part.x1 <= to.width && part.y1 <= to.height);
  assert(image.width == part.width() && image.height == part.height() && image.channels == to.channels);
  for (int c = 0; c < image.channels; ++c)
    for (int y = 0; y < image.height; ++y)
      std::copy_n(image.plane(c).data() + std::ptrdiff_t(y) * image.width, image.width,
                  to.plane(c).data() + std::ptrdiff_t(part.y0 + y) * to.width + part.x0);
}

Mask cut_out(const Mask& mask, Rect part) {
  assert(part.x0 >= 0 && part.y0 >= 0 && part.x1 <= mask.width && part.y1 <= mask.height);
  Mask out(part.width(), part.height());
  for (int y = 0; y < out.height; ++y)
    std::copy_n(mask.data.begin() + std::ptrdiff_t(part.y0 + y) * mask.width + part.x0, out.width,
                out.data.begin() + std::ptrdiff_t(y) * out.width);
  return out;
}

Rect bounding_box(const Mask& mask) {
  Rect box{mask.width, mask.height, 0, 0};
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x)
      if (mask.at(x, y) != 0) {
        box.x0 = std::min(box.x0, x), box.x1 = std::max(box.x1, x + 1);
        box.y0 = std::min(box.y0, y), box.y1 = y + 1;
      }
  return box.empty() ? Rect{} : box;
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
