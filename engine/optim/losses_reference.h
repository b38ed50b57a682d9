// The formulas of losses.h and perceptual.h as the papers print them, and slow passes built from them: the judge of
// the vector kernels. Templated, so that central differences can check the gradients in double.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "engine/optim/losses.h"
#include "engine/optim/perceptual.h"

namespace engine::optim::reference {

/// |d| without its kink.
template <std::floating_point Real>
Real smooth_l1(Real d, SmoothL1 kind, Real scale) noexcept {
  if (kind == SmoothL1::charbonnier) return std::sqrt(d * d + scale * scale) - scale;
  return std::max(std::abs(d) - scale, Real(0));
}
/// dL/dd for v_out = dL/d(out). At the kinks of the dead zone: the derivative of its inside, 0.
template <std::floating_point Real>
Real smooth_l1_vjp(Real d, SmoothL1 kind, Real scale, Real v_out) noexcept {
  if (kind == SmoothL1::charbonnier) return v_out * d / std::sqrt(d * d + scale * scale);
  return std::abs(d) <= scale ? Real(0) : (d > 0 ? v_out : -v_out);
}

/// Statistics of a window that SSIM needs: weighted means of x, y, x^2, y^2 and xy.
template <std::floating_point Real>
struct WindowStatistics {
  Real x = 0, y = 0, xx = 0, yy = 0, xy = 0;
};

template <std::floating_point Real>
constexpr Real ssim_c1 = Real(0.01) * Real(0.01);
template <std::floating_point Real>
constexpr Real ssim_c2 = Real(0.03) * Real(0.03);

/// Wang 2004, eq. 13, or its contrast-structure factor alone.
template <std::floating_point Real>
Real ssim(const WindowStatistics<Real>& m, SsimTerm term) noexcept {
  const Real luminance = (2 * m.x * m.y + ssim_c1<Real>) / (m.x * m.x + m.y * m.y + ssim_c1<Real>);
  const Real contrast =
      (2 * (m.xy - m.x * m.y) + ssim_c2<Real>) / ((m.xx - m.x * m.x) + (m.yy - m.y * m.y) + ssim_c2<Real>);
  return term == SsimTerm::full ? luminance * contrast : contrast;
}
/// dL/d(moments that depend on x) for v_out = dL/d(ssim); y is constant.
template <std::floating_point Real>
WindowStatistics<Real> ssim_vjp(const WindowStatistics<Real>& m, SsimTerm term, Real v_out) noexcept {
  const Real luminance_below = m.x * m.x + m.y * m.y + ssim_c1<Real>;
  const Real luminance = (2 * m.x * m.y + ssim_c1<Real>) / luminance_below;
  const Real contrast_below = (m.xx - m.x * m.x) + (m.yy - m.y * m.y) + ssim_c2<Real>;
  const Real contrast = (2 * (m.xy - m.x * m.y) + ssim_c2<Real>) / contrast_below;
  const Real v_luminance = term == SsimTerm::full ? v_out * contrast : Real(0);
  const Real v_contrast = term == SsimTerm::full ? v_out * luminance : v_out;
  WindowStatistics<Real> v;
  v.xx = -v_contrast * contrast / contrast_below;
  v.xy = 2 * v_contrast / contrast_below;
  v.x = v_luminance * (2 * m.y - 2 * m.x * luminance) / luminance_below - v.xy * m.y - 2 * m.x * v.xx;
  return v;
}

/// One channel.
template <std::floating_point Real>
struct Plane {
  int width = 0, height = 0;
  std::vector<Real> data;

  Plane() = default;
  Plane(int w, int h) : width(w), height(h), data(std::size_t(w) * std::size_t(h)) {}
  [[nodiscard]] Real& at(int x, int y) { return data[std::size_t(y) * std::size_t(width) + std::size_t(x)]; }
  [[nodiscard]] Real at(int x, int y) const { return data[std::size_t(y) * std::size_t(width) + std::size_t(x)]; }
};

/// Weights of the window along one axis: Gaussian of sigma 1.5, sum 1.
template <std::floating_point Real>
std::array<Real, 11> ssim_window() {
  std::array<Real, 11> window;
  for (int k = 0; k < 11; ++k)
    window[std::size_t(k)] = std::exp(-Real((k - 5) * (k - 5)) / (2 * Real(1.5) * Real(1.5)));
  const Real sum = std::accumulate(window.begin(), window.end(), Real(0));
  for (Real& weight : window) weight /= sum;
  return window;
}

template <std::floating_point Real>
struct SsimPass {
  Plane<Real> map;  ///< Of the term, 1 where masked.
  Real sum = 0;     ///< Of 1 - map.
  Plane<Real> v_x;  ///< Gradient of `sum`.
};

/// Forward and backward over one channel, every window by itself.
///   mask  [pixels] or empty
template <std::floating_point Real>
SsimPass<Real> ssim_pass(const Plane<Real>& x, const Plane<Real>& y, std::span<const std::uint8_t> mask,
                         SsimTerm term) {
  const auto window = ssim_window<Real>();
  SsimPass<Real> out{.map = Plane<Real>(x.width, x.height), .sum = 0, .v_x = Plane<Real>(x.width, x.height)};
  auto for_window = [&](int column, int row, auto&& body) {
    for (int dy = -5; dy <= 5; ++dy)
      for (int dx = -5; dx <= 5; ++dx) {
        const int px = column + dx, py = row + dy;
        if (px < 0 || py < 0 || px >= x.width || py >= x.height) continue;  // zero padding
        body(px, py, window[std::size_t(dx + 5)] * window[std::size_t(dy + 5)]);
      }
  };
  for (int row = 0; row < x.height; ++row)
    for (int column = 0; column < x.width; ++column) {
      if (!mask.empty() && mask[std::size_t(row) * std::size_t(x.width) + std::size_t(column)] != 0) {
        out.map.at(column, row) = 1;
        continue;
      }
      WindowStatistics<Real> m;
      for_window(column, row, [&](int px, int py, Real weight) {
        const Real xi = x.at(px, py), yi = y.at(px, py);
        m.x += weight * xi, m.y += weight * yi;
        m.xx += weight * xi * xi, m.yy += weight * yi * yi, m.xy += weight * xi * yi;
      });
      out.map.at(column, row) = ssim(m, term);
      out.sum += 1 - out.map.at(column, row);
      const WindowStatistics<Real> v = ssim_vjp(m, term, Real(-1));
      for_window(column, row, [&](int px, int py, Real weight) {
        out.v_x.at(px, py) += weight * (v.x + 2 * x.at(px, py) * v.xx + y.at(px, py) * v.xy);
      });
    }
  return out;
}

/// Means of 2 x 2 pixels; an odd last row or column is left out.
template <std::floating_point Real>
Plane<Real> halved(const Plane<Real>& fine) {
  Plane<Real> coarse(fine.width / 2, fine.height / 2);
  for (int y = 0; y < coarse.height; ++y)
    for (int x = 0; x < coarse.width; ++x)
      coarse.at(x, y) = (fine.at(2 * x, 2 * y) + fine.at(2 * x + 1, 2 * y) + fine.at(2 * x, 2 * y + 1) +
                         fine.at(2 * x + 1, 2 * y + 1)) /
                        4;
  return coarse;
}

/// 1 - MS-SSIM of one channel (Wang, Simoncelli, Bovik 2003, eq. 7), as MsSsimLoss takes it. Value only: its gradient
/// is checked by differences of this.
template <std::floating_point Real>
Real ms_ssim_loss(Plane<Real> x, Plane<Real> y, const MsSsimOptions& options) {
  const int scales = ms_ssim_scales(x.width, x.height);
  const auto weight = ms_ssim_weights(scales);
  Real product = 1;
  for (int j = 0; j < scales; ++j) {
    const SsimTerm term = j + 1 == scales ? SsimTerm::full : SsimTerm::contrast_structure;
    const Real mean = 1 - ssim_pass<Real>(x, y, {}, term).sum / Real(x.data.size());
    product *= std::pow(std::max(mean, Real(options.floor)), Real(weight[std::size_t(j)]));
    x = halved(x), y = halved(y);
  }
  return 1 - product;
}

}  // namespace engine::optim::reference
