// How alike two pictures are, inside or outside a mask.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "engine/optim/losses.h"
#include "engine/optim/picture_view.h"
#include "engine/scene/image.h"

namespace engine::edit {

/// PSNR over the pixels that `mask` has as `value`; infinity if they are equal.
inline double psnr_where(const scene::Image& a, const scene::Image& b, const scene::Mask& mask, std::uint8_t value) {
  double sum = 0, count = 0;
  for (int c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < mask.data.size(); ++i) {
      if (mask.data[i] != value) continue;
      const double difference = double(a.plane(c)[i]) - double(b.plane(c)[i]);
      sum += difference * difference, ++count;
    }
  return sum == 0 ? std::numeric_limits<double>::infinity() : -10 * std::log10(sum / count);
}

/// SSIM over all pixels, those of the mask counted as equal.
inline double ssim_outside(const scene::Image& a, const scene::Image& b, const scene::Mask& mask) {
  optim::LossWorkspace workspace;
  scene::Image gradient(a.width, a.height, 3);
  return 1 - optim::ssim_loss(optim::view(a), optim::view(b), optim::view(mask), a.pixels(), 1, workspace,
                              optim::view(gradient));
}

}  // namespace engine::edit
