// What the scalar passes, forward and backward, walk over: the visible splats in depth order, and the pixels each is
// tried at.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/render/forward.h"
#include "engine/render/layers.h"
#include "engine/render/project.h"

namespace engine::render {

/// One visible Gaussian in the picture.
template <std::floating_point Real>
struct ReferenceSplat {
  Projection<Real> at;
  Real opacity;               ///< min_alpha or more.
  std::array<Real, 3> color;  ///< Seen from the camera, clamped.
  std::uint32_t row;          ///< Of the Gaussian in its layers.
};

/// A row of the layers: the cloud that holds it, and its number there.
struct LayerRow {
  const scene::GaussianCloud& cloud;
  std::size_t row;
};
inline LayerRow layer_row(const Layers& layers, std::size_t row) {
  const std::size_t base_rows = layers.base->size();
  return row < base_rows ? LayerRow{*layers.base, row} : LayerRow{*layers.top, row - base_rows};
}

/// The stored values of a Gaussian, as project() takes them.
template <std::floating_point Real>
struct StoredShape {
  std::array<Real, 3> mean, log_scale;
  std::array<Real, 4> rotation;

  explicit StoredShape(LayerRow at)
      : mean{at.cloud.mean.x[at.row], at.cloud.mean.y[at.row], at.cloud.mean.z[at.row]},
        log_scale{at.cloud.log_scale.x[at.row], at.cloud.log_scale.y[at.row], at.cloud.log_scale.z[at.row]},
        rotation{at.cloud.rotation.w[at.row], at.cloud.rotation.x[at.row], at.cloud.rotation.y[at.row],
                 at.cloud.rotation.z[at.row]} {}
};

/// All splats that can reach alpha 1/255 in front of the near plane, nearest first; ties in row order. Some of them may
/// lie beside the picture.
template <std::floating_point Real>
std::vector<ReferenceSplat<Real>> reference_splats(const Layers& layers, const ViewParams<Real>& view,
                                                   const ForwardOptions& options) {
  const int degree = std::min(layers.base->sh_degree, options.max_sh_degree);
  std::vector<ReferenceSplat<Real>> splats;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    if (std::binary_search(layers.hidden.begin(), layers.hidden.end(), i)) continue;
    const LayerRow at = layer_row(layers, i);
    const StoredShape<Real> stored(at);
    ReferenceSplat<Real> splat;
    splat.row = std::uint32_t(i);
    splat.opacity = opacity(Real(at.cloud.opacity_logit[at.row]));
    if (splat.opacity < Real(min_alpha)) continue;  // can nowhere reach it
    splat.at = project<Real>(view, stored.mean, stored.log_scale, stored.rotation);
    if (!splat.at.visible) continue;
    splat.color = color(view, stored.mean, at.cloud.sh_row(at.row), degree);
    if (const Tint& tint = options.tint; !tint.rows.empty() && tint.rows[i] != 0)
      for (int c = 0; c < 3; ++c)
        splat.color[std::size_t(c)] =
            Real(1 - tint.strength) * splat.color[std::size_t(c)] + Real(tint.strength * tint.color[c]);
    splats.push_back(splat);
  }
  std::stable_sort(splats.begin(), splats.end(), [](const ReferenceSplat<Real>& a, const ReferenceSplat<Real>& b) {
    return a.at.depth < b.at.depth;
  });
  return splats;
}

/// Half-open range of pixel indices.
struct PixelSpan {
  int begin, end;
};

/// Columns and rows a splat is tried at: all those where its alpha can reach 1/255, with a pixel to spare; with
/// tile16_stop, those of the tiles it meets.
template <std::floating_point Real>
std::array<PixelSpan, 2> reach_of(const ReferenceSplat<Real>& splat, Semantics semantics, int width, int height) {
  if (semantics == Semantics::tile16_stop) {
    // The square of three sigmas of the larger eigenvalue, widened to whole tiles.
    const Real a = splat.at.sigma_x * splat.at.sigma_x, c = splat.at.sigma_y * splat.at.sigma_y;
    const Real middle = (a + c) / 2, determinant = a * c - splat.at.covariance_xy * splat.at.covariance_xy;
    const Real radius =
        std::ceil(3 * std::sqrt(middle + std::sqrt(std::max(Real(0.1), middle * middle - determinant))));
    const auto tiles = [&](Real at, int size) {
      const int count = (size + tile_size - 1) / tile_size;
      const Real first = std::trunc((at - radius) / tile_size);
      const Real end = std::trunc((at + radius + tile_size - 1) / tile_size);
      return PixelSpan{int(std::clamp(first, Real(0), Real(count))) * tile_size,
                       std::min(size, int(std::clamp(end, Real(0), Real(count))) * tile_size)};
    };
    return {tiles(splat.at.x, width), tiles(splat.at.y, height)};
  }
  const Real sigmas = std::sqrt(2 * std::log(splat.opacity / Real(min_alpha)));  // at which alpha is 1/255
  const auto around = [](Real middle, Real reach, int size) {
    const Real low = std::clamp(std::ceil(middle - reach), Real(0), Real(size));
    const Real high = std::clamp(std::floor(middle + reach) + 1, Real(0), Real(size));
    return PixelSpan{int(low), int(high)};
  };
  return {around(splat.at.x, sigmas * splat.at.sigma_x + 1, width),
          around(splat.at.y, sigmas * splat.at.sigma_y + 1, height)};
}

}  // namespace engine::render
