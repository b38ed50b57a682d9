// Pullbacks of the formulas of project.h: dL/d(arguments) from dL/d(result), for one Gaussian and one camera.
// v_x is dL/dx. Each recomputes what it needs of its formula and stores nothing.
//
// Every clamp has its true derivative: zero beyond, and at the very edge the derivative from inside, so that a
// parameter that sits on the edge can leave it. What is not visible has no gradient.
#pragma once

#include "engine/render/project.h"

namespace engine::render {

/// Pullback of rotation_matrix(): the gradient has no component along the quaternion, whose length means nothing. One
/// no longer than the guard has no direction to turn from: its gradient is zero.
template <std::floating_point Real>
std::array<Real, 4> rotation_matrix_vjp(Real w, Real x, Real y, Real z, const std::array<Real, 9>& v_r) {
  const Real largest = std::max({std::abs(w), std::abs(x), std::abs(y), std::abs(z), Real(1e-30)});
  w /= largest, x /= largest, y /= largest, z /= largest;
  const Real length = std::sqrt(w * w + x * x + y * y + z * z);
  if (!(length > Real(1e-12) / largest)) return {};
  w /= length, x /= length, y /= length, z /= length;
  const std::array<Real, 4> unit{w, x, y, z};
  std::array<Real, 4> v{
      2 * (x * (v_r[7] - v_r[5]) + y * (v_r[2] - v_r[6]) + z * (v_r[3] - v_r[1])),
      2 * (y * (v_r[1] + v_r[3]) + z * (v_r[2] + v_r[6]) + w * (v_r[7] - v_r[5]) - 2 * x * (v_r[4] + v_r[8])),
      2 * (x * (v_r[1] + v_r[3]) + z * (v_r[5] + v_r[7]) + w * (v_r[2] - v_r[6]) - 2 * y * (v_r[0] + v_r[8])),
      2 * (x * (v_r[2] + v_r[6]) + y * (v_r[5] + v_r[7]) + w * (v_r[3] - v_r[1]) - 2 * z * (v_r[0] + v_r[4]))};
  const Real along = v[0] * w + v[1] * x + v[2] * y + v[3] * z;
  for (std::size_t i = 0; i < 4; ++i) v[i] = (v[i] - along * unit[i]) / length / largest;
  return v;
}

/// dL/d(projection), as blending sums it over pixels. With the falloff's matrix K = [l1 l2; 0 l3], the last three are
/// dL/dE for an infinitesimal strain K -> (I - E) K, E upper triangular; that is, minus the upper triangle of v_K K^T.
/// Of a falloff they are sums of products of K d, numbers of order one. dL/d(conic) is of order (length of the splat)^2
/// and cancels on the way on: 3 % off in float for a needle of 1000 pixels.
template <std::floating_point Real>
struct ProjectionGradient {
  Real x = 0, y = 0;  ///< Per pixel.
  Real depth = 0;     ///< Per world unit.
  Real strain_11 = 0, strain_12 = 0, strain_22 = 0;
};

/// dL/d(stored values) of a Gaussian's shape and place.
template <std::floating_point Real>
struct GaussianGradient {
  std::array<Real, 3> mean{}, log_scale{};
  std::array<Real, 4> rotation{};  ///< Of (w, x, y, z) as stored, of whatever length.
};

/// Pullback of project(). sigma_x, sigma_y and covariance_xy only say where to look for pixels: no loss reaches them.
/// Source: the chain rule; for K, dK = -F K where F is the upper half of K dcov K^T (Murray 2016, "Differentiation of
/// the Cholesky decomposition", section 3, with K the inverse factor).
template <std::floating_point Real>
GaussianGradient<Real> project_vjp(const ViewParams<Real>& view, std::array<Real, 3> mean,
                                   std::array<Real, 3> log_scale, std::array<Real, 4> rotation_wxyz,
                                   const ProjectionGradient<Real>& v_out) {
  using Vector = std::array<Real, 3>;
  const auto dot = [](const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
  const auto cross = [](const Vector& a, const Vector& b) {
    return Vector{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  };
  const auto& camera = view.rotation;

  // As in project().
  Vector d, p;
  for (std::size_t i = 0; i < 3; ++i) d[i] = (mean[i] - view.centre_high[i]) - view.centre_low[i];
  for (std::size_t i = 0; i < 3; ++i) p[i] = camera[3 * i] * d[0] + camera[3 * i + 1] * d[1] + camera[3 * i + 2] * d[2];
  if (!project(view, mean, log_scale, rotation_wxyz).visible) return {};
  const Real x_over_z = p[0] / p[2], y_over_z = p[1] / p[2];
  const Real jx = view.fx / p[2], jy = view.fy / p[2];
  const Real tx = std::clamp(x_over_z, view.min_x_over_z, view.max_x_over_z);
  const Real ty = std::clamp(y_over_z, view.min_y_over_z, view.max_y_over_z);
  const auto r = rotation_matrix(rotation_wxyz[0], rotation_wxyz[1], rotation_wxyz[2], rotation_wxyz[3]);
  Vector sigma, u, v;
  std::array<Vector, 3> axes;
  for (std::size_t j = 0; j < 3; ++j) {
    sigma[j] = std::exp(std::clamp(log_scale[j], Real(-max_log_scale), Real(max_log_scale)));
    for (std::size_t i = 0; i < 3; ++i)
      axes[j][i] = (camera[3 * i] * r[j] + camera[3 * i + 1] * r[3 + j] + camera[3 * i + 2] * r[6 + j]) * sigma[j];
    u[j] = jx * (axes[j][0] - tx * axes[j][2]);
    v[j] = jy * (axes[j][1] - ty * axes[j][2]);
  }
  Real unit = 1;
  for (std::size_t j = 0; j < 3; ++j) unit = std::max({unit, std::abs(u[j]), std::abs(v[j])});
  for (std::size_t j = 0; j < 3; ++j) u[j] /= unit, v[j] /= unit;
  const Real low_pass = Real(low_pass_px2) / (unit * unit);
  const Vector normal = cross(u, v);
  const Real determinant = dot(normal, normal) + low_pass * (dot(u, u) + dot(v, v)) + low_pass * low_pass;
  const Real yy = dot(v, v) + low_pass;
  const Real l1 = std::sqrt(yy / determinant), l3 = 1 / std::sqrt(yy), l2 = -l1 * dot(u, v) / yy;  // times 1 / unit

  // The strain to the rows: v_[u; v] = K^T E' K [u; v], E' the symmetric matrix of the three. The first row of
  // K [u; v], l1 u + l2 v, is what is left of u without its part along v: by Lagrange again, without cancellation.
  const Vector rest = cross(v, normal);
  Vector v_u, v_v;  // of the rows in pixels
  for (std::size_t j = 0; j < 3; ++j) {
    const Real along = l1 * (rest[j] + low_pass * u[j]) / yy, across = l3 * v[j];
    const Real v_along = v_out.strain_11 * along + v_out.strain_12 * across;
    const Real v_across = v_out.strain_12 * along + v_out.strain_22 * across;
    v_u[j] = l1 / unit * v_along;
    v_v[j] = (l2 * v_along + l3 * v_across) / unit;
  }

  GaussianGradient<Real> out;
  std::array<Real, 9> v_r;
  Real v_tx = 0, v_ty = 0;
  for (std::size_t j = 0; j < 3; ++j) {
    v_tx -= jx * v_u[j] * axes[j][2];
    v_ty -= jy * v_v[j] * axes[j][2];
    const Vector v_axis{jx * v_u[j], jy * v_v[j], -jx * tx * v_u[j] - jy * ty * v_v[j]};
    if (std::abs(log_scale[j]) <= Real(max_log_scale)) out.log_scale[j] = dot(v_axis, axes[j]);
    for (std::size_t i = 0; i < 3; ++i)
      v_r[3 * i + j] = sigma[j] * (camera[i] * v_axis[0] + camera[3 + i] * v_axis[1] + camera[6 + i] * v_axis[2]);
  }
  out.rotation = rotation_matrix_vjp(rotation_wxyz[0], rotation_wxyz[1], rotation_wxyz[2], rotation_wxyz[3], v_r);

  const Real v_x_over_z = view.fx * v_out.x + (tx == x_over_z ? v_tx : 0);
  const Real v_y_over_z = view.fy * v_out.y + (ty == y_over_z ? v_ty : 0);
  // jx and jy go with 1 / z, and with them all of u and v.
  const Real v_size = unit * (dot(v_u, u) + dot(v_v, v));
  const Vector v_p{v_x_over_z / p[2], v_y_over_z / p[2],
                   v_out.depth - (v_x_over_z * x_over_z + v_y_over_z * y_over_z + v_size) / p[2]};
  for (std::size_t i = 0; i < 3; ++i)
    out.mean[i] = camera[i] * v_p[0] + camera[3 + i] * v_p[1] + camera[6 + i] * v_p[2];
  return out;
}

/// Pullback of opacity(). Both factors of a (1 - a) are computed as sigmoids: 1 - a is zero in float from 17 on.
template <std::floating_point Real>
Real opacity_vjp(Real logit, Real v_opacity) {
  if (!(std::abs(logit) <= Real(max_opacity_logit))) return 0;
  return v_opacity * opacity(logit) * opacity(-logit);
}

/// Pullback of color(): adds dL/dsh to v_sh and returns dL/dmean, which comes through the direction.
///   v_sh  [3][(degree_stored + 1)^2], as `sh`; bands above `degree` stay as they are
template <std::floating_point Real>
std::array<Real, 3> color_vjp(const ViewParams<Real>& view, std::array<Real, 3> mean, std::span<const float> sh,
                              int degree, std::array<Real, 3> v_rgb, std::span<Real> v_sh) {
  std::array<Real, 3> d;
  for (std::size_t i = 0; i < 3; ++i) d[i] = (mean[i] - view.centre_high[i]) - view.centre_low[i];
  const Real length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  for (Real& value : d) value /= length;
  std::array<Real, 16> basis, v_basis{};
  scene::sh_basis(degree, d[0], d[1], d[2], basis.data());
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
  const auto v_d = scene::sh_basis_vjp(degree, d[0], d[1], d[2], v_basis.data());
  const Real along = v_d[0] * d[0] + v_d[1] * d[1] + v_d[2] * d[2];
  std::array<Real, 3> v_mean;
  for (std::size_t i = 0; i < 3; ++i) v_mean[i] = (v_d[i] - along * d[i]) / length;
  return v_mean;
}

}  // namespace engine::render
