// The colour that a Gaussian has from all sides alike.
#pragma once

#include <cstddef>

#include "engine/core/vec.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/sh.h"

namespace engine::scene {

/// Of SH band 0; not clamped.
[[nodiscard]] inline Vec3 base_color(const GaussianCloud& cloud, std::size_t row) {
  const std::size_t stride = sh_coefficients(cloud.sh_degree);
  Vec3 color;
  for (int c = 0; c < 3; ++c) color[c] = 0.5f + float(sh_c0) * cloud.sh_row(row)[std::size_t(c) * stride];
  return color;
}

}  // namespace engine::scene
