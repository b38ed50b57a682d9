#include "engine/render/reference.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace engine::render {
namespace {

template <std::floating_point Real>
struct Splat {
  Projection<Real> at;
  Real opacity;
  std::array<Real, 3> color;
  Real weight;
};

/// Half-open range of pixel indices.
struct Span {
  int begin, end;
};

/// Pixels whose index lies within `reach` of `middle`, clipped to [0, size).
template <std::floating_point Real>
Span pixels_around(Real middle, Real reach, int size) {
  const Real low = std::clamp(std::ceil(middle - reach), Real(0), Real(size));
  const Real high = std::clamp(std::floor(middle + reach) + 1, Real(0), Real(size));
  return {int(low), int(high)};
}

/// The pixels a splat is tried at: all those where its alpha can reach 1/255, with a pixel to spare.
template <std::floating_point Real>
std::array<Span, 2> reach_of(const Splat<Real>& splat, Semantics semantics, int width, int height) {
  if (semantics == Semantics::tile16_stop) {
    // The square of three sigmas of the larger eigenvalue, widened to whole tiles.
    const Real a = splat.at.sigma_x * splat.at.sigma_x, c = splat.at.sigma_y * splat.at.sigma_y;
    const Real middle = (a + c) / 2, determinant = a * c - splat.at.covariance_xy * splat.at.covariance_xy;
    const Real radius =
        std::ceil(3 * std::sqrt(middle + std::sqrt(std::max(Real(0.1), middle * middle - determinant))));
    auto tiles = [&](Real at, int size) {
      const int count = (size + tile_size - 1) / tile_size;
      const Real first = std::trunc((at - radius) / tile_size);
      const Real end = std::trunc((at + radius + tile_size - 1) / tile_size);
      return Span{int(std::clamp(first, Real(0), Real(count))) * tile_size,
                  std::min(size, int(std::clamp(end, Real(0), Real(count))) * tile_size)};
    };
    return {tiles(splat.at.x, width), tiles(splat.at.y, height)};
  }
  const Real reach = std::sqrt(2 * std::log(splat.opacity / Real(min_alpha)));  // sigmas at which alpha is 1/255
  return {pixels_around(splat.at.x, reach * splat.at.sigma_x + 1, width),
          pixels_around(splat.at.y, reach * splat.at.sigma_y + 1, height)};
}

template <std::floating_point Real>
std::vector<Splat<Real>> visible_splats(const scene::GaussianCloud& cloud, const ViewParams<Real>& view,
                                        const ForwardOptions& options, std::span<const Real> weight) {
  std::vector<Splat<Real>> splats;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const std::array<Real, 3> mean{cloud.mean.x[i], cloud.mean.y[i], cloud.mean.z[i]};
    Splat<Real> splat;
    splat.opacity = opacity(Real(cloud.opacity_logit[i]));
    if (splat.opacity < Real(min_alpha)) continue;  // can nowhere reach it
    splat.at = project<Real>(view, mean, {cloud.log_scale.x[i], cloud.log_scale.y[i], cloud.log_scale.z[i]},
                             {cloud.rotation.w[i], cloud.rotation.x[i], cloud.rotation.y[i], cloud.rotation.z[i]});
    if (!splat.at.visible) continue;
    splat.color = color(view, mean, cloud.sh_row(i), std::min(cloud.sh_degree, options.max_sh_degree));
    splat.weight = weight.empty() ? Real(0) : weight[i];
    splats.push_back(splat);
  }
  std::stable_sort(splats.begin(), splats.end(),
                   [](const Splat<Real>& a, const Splat<Real>& b) { return a.at.depth < b.at.depth; });
  return splats;
}

}  // namespace

template <std::floating_point Real>
ReferencePictures<Real> forward_reference(const scene::GaussianCloud& cloud, const scene::Camera& camera,
                                          const ForwardOptions& options, std::span<const Real> weight) {
  const std::size_t pixels = std::size_t(camera.width) * std::size_t(camera.height);
  ReferencePictures<Real> out;
  for (auto& plane : out.color) plane.assign(pixels, 0);
  out.depth.assign(pixels, 0);
  out.median_depth.assign(pixels, 0);
  out.weight.assign(pixels, 0);
  out.contributions.assign(pixels, 0);
  std::vector<Real> transmittance(pixels, 1);
  std::vector<std::uint8_t> ended(pixels, 0);

  for (const Splat<Real>& splat : visible_splats(cloud, view_params<Real>(camera), options, weight)) {
    const auto [columns, rows] = reach_of(splat, options.semantics, camera.width, camera.height);
    for (int y = rows.begin; y < rows.end; ++y)
      for (int x = columns.begin; x < columns.end; ++x) {
        const std::size_t pixel = std::size_t(y) * std::size_t(camera.width) + std::size_t(x);
        if (ended[pixel]) continue;
        const Real dx = Real(x) - splat.at.x, dy = Real(y) - splat.at.y;
        const Real along = splat.at.l1 * dx + splat.at.l2 * dy, across = splat.at.l3 * dy;
        const Real alpha =
            std::min(Real(max_alpha), splat.opacity * std::exp(Real(-0.5) * (along * along + across * across)));
        if (alpha < Real(min_alpha)) continue;
        const Real before = transmittance[pixel], after = before * (1 - alpha);
        if (options.semantics != Semantics::dense_nostop && after < Real(min_transmittance)) {
          ended[pixel] = 1;
          continue;
        }
        const Real blend = before * alpha;
        for (std::size_t c = 0; c < 3; ++c) out.color[c][pixel] += blend * splat.color[c];
        out.depth[pixel] += blend * splat.at.depth;
        out.weight[pixel] += blend * splat.weight;
        if (before >= Real(0.5) && after < Real(0.5)) out.median_depth[pixel] = splat.at.depth;
        transmittance[pixel] = after;
        ++out.contributions[pixel];
      }
  }
  out.alpha.resize(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    for (int c = 0; c < 3; ++c) out.color[std::size_t(c)][i] += transmittance[i] * Real(options.background[c]);
    out.alpha[i] = 1 - transmittance[i];
  }
  return out;
}

template ReferencePictures<float> forward_reference(const scene::GaussianCloud&, const scene::Camera&,
                                                    const ForwardOptions&, std::span<const float>);
template ReferencePictures<double> forward_reference(const scene::GaussianCloud&, const scene::Camera&,
                                                     const ForwardOptions&, std::span<const double>);

}  // namespace engine::render
