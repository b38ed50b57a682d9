// Pullbacks of the formulas of project.h, in plain numbers: dL/d(arguments) from dL/d(result), for one Gaussian and one
// camera. The formulas are those of projection_vjp.inc, which the vector kernels share.
// v_x is dL/dx. Each recomputes what it needs of its formula and stores nothing. What is not visible has no gradient.
#pragma once

#include "engine/render/project.h"

namespace engine::render {

#include "engine/render/projection_vjp.inc"

/// Pullback of rotation_matrix().
///   v_r  [9] row by row
template <std::floating_point Real>
std::array<Real, 4> rotation_matrix_vjp(Real w, Real x, Real y, Real z, const std::array<Real, 9>& v_r) {
  return rotation_matrix_vjp(unit_quaternion<Real>({w, x, y, z}), v_r);
}

/// Pullback of project().
template <std::floating_point Real>
GaussianGradient<Real> project_vjp(const ViewParams<Real>& view, std::array<Real, 3> mean,
                                   std::array<Real, 3> log_scale, std::array<Real, 4> rotation_wxyz,
                                   const ProjectionGradient<Real>& v_out) {
  if (!project(view, mean, log_scale, rotation_wxyz).visible) return {};
  return project_vjp(view, reproject(view, mean, log_scale, rotation_wxyz), log_scale, v_out);
}

/// Pullback of opacity(). Both factors of a (1 - a) are computed as sigmoids: see logit_vjp().
template <std::floating_point Real>
Real opacity_vjp(Real logit, Real v_opacity) {
  return logit_vjp(logit, v_opacity * opacity(logit));
}

/// Pullback of direction(): dL/d(mean) = (v_to - (v_to . to) to) / distance.
template <std::floating_point Real>
[[gnu::always_inline]] inline std::array<Real, 3> direction_vjp(const std::array<Real, 3>& to, Real inverse_distance,
                                                                const std::array<Real, 3>& v_to) {
  const Real along = v_to[0] * to[0] + v_to[1] * to[1] + v_to[2] * to[2];
  const auto tangent = [&](std::size_t i) { return (v_to[i] - along * to[i]) * inverse_distance; };
  return {tangent(0), tangent(1), tangent(2)};
}

/// Pullback of color(): adds dL/dsh to v_sh and returns dL/dmean, which comes through the direction.
///   v_sh  [3][(degree_stored + 1)^2], as `sh`; bands above `degree` stay as they are
template <std::floating_point Real>
std::array<Real, 3> color_vjp(const ViewParams<Real>& view, std::array<Real, 3> mean, std::span<const float> sh,
                              int degree, std::array<Real, 3> v_rgb, std::span<Real> v_sh) {
  const auto [to, inverse_distance] = direction(from_centre(view, mean));
  std::array<Real, 16> basis, v_basis{};
  scene::sh_basis(degree, to[0], to[1], to[2], basis.data());
  const std::size_t stored = sh.size() / 3, used = std::size_t(degree + 1) * std::size_t(degree + 1);
  for (std::size_t c = 0; c < 3; ++c) {
    Real sum = Real(0.5);
    for (std::size_t k = 0; k < used; ++k) sum += Real(sh[c * stored + k]) * basis[k];
    if (!(sum >= 0 && sum <= Real(max_color))) continue;  // also when it is NaN
    for (std::size_t k = 0; k < used; ++k) {
      v_sh[c * stored + k] += v_rgb[c] * basis[k];
      v_basis[k] += v_rgb[c] * Real(sh[c * stored + k]);
    }
  }
  return direction_vjp(to, inverse_distance, scene::sh_basis_vjp(degree, to[0], to[1], to[2], v_basis.data()));
}

}  // namespace engine::render
