// One Gaussian through one camera: the formulas of projection, for the reference pass and for tests.
// Source: Zwicker et al. 2001, "EWA volume splatting", eqs. 24-31; Kerbl et al. 2023, section 4 and eqs. 5-6.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <span>

#include "engine/scene/camera.h"
#include "engine/scene/sh.h"

namespace engine::render {

constexpr double near_plane = 0.2;    ///< World units along the optical axis: at or before this, a Gaussian is dropped.
constexpr double low_pass_px2 = 0.3;  ///< Added to the diagonal of a 2D covariance: no splat is thinner than a pixel.
constexpr double fov_margin = 0.3;    ///< The Jacobian is evaluated at most this many half fields of view outside.
constexpr double max_alpha = 0.99;    ///< One splat never hides all that lies behind it.
constexpr double min_alpha = 1.0 / 255.0;   ///< Less than one 8-bit step: not blended.
constexpr double min_transmittance = 1e-4;  ///< A ray ends before it would fall below this.
constexpr double max_log_scale = 20.0;      ///< exp() of more overflows float once squared; saturates.
constexpr double max_opacity_logit = 30.0;  ///< The sigmoid is 0 or 1 to float precision beyond; saturates.
constexpr double max_color = 65504.0;  ///< Largest half float: colours saturate, so that sums stay finite in any file.

/// A camera as projection needs it. The centre is split in two so that float arithmetic near it loses nothing in a
/// scene far from the origin: mean - centre_high is exact where it matters (Sterbenz), centre_low is the rest.
template <std::floating_point Real>
struct ViewParams {
  std::array<Real, 9> rotation;                                 ///< Row-major, cam_from_world.
  std::array<Real, 3> centre_high, centre_low;                  ///< World units.
  Real fx, fy;                                                  ///< Pixels.
  Real cx, cy;                                                  ///< Pixel-index units: column i has its centre at i.
  Real min_x_over_z, max_x_over_z, min_y_over_z, max_y_over_z;  ///< Clamp of the Jacobian's point of evaluation.
};

template <std::floating_point Real>
ViewParams<Real> view_params(const scene::Camera& camera) {
  ViewParams<Real> view;
  const DVec3 centre = camera.centre();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) view.rotation[std::size_t(3 * i + j)] = Real(camera.rotation[j][i]);
    view.centre_high[std::size_t(i)] = Real(centre[i]);
    view.centre_low[std::size_t(i)] = Real(centre[i] - double(view.centre_high[std::size_t(i)]));
  }
  view.fx = Real(camera.fx);
  view.fy = Real(camera.fy);
  view.cx = Real(camera.cx - 0.5);
  view.cy = Real(camera.cy - 0.5);
  const double margin_x = fov_margin * camera.width / (2 * camera.fx);
  const double margin_y = fov_margin * camera.height / (2 * camera.fy);
  view.min_x_over_z = Real(-camera.cx / camera.fx - margin_x);
  view.max_x_over_z = Real((camera.width - camera.cx) / camera.fx + margin_x);
  view.min_y_over_z = Real(-camera.cy / camera.fy - margin_y);
  view.max_y_over_z = Real((camera.height - camera.cy) / camera.fy + margin_y);
  return view;
}

/// Rotation matrix (row-major, world_from_local) of a quaternion (w, x, y, z) of any length.
/// Divides by max(length, 1e-12), so that the zero quaternion is the identity and not NaN; the length is taken of the
/// quaternion over its largest component, since squares of 1e-20 or 1e20 leave float's range.
template <std::floating_point Real>
std::array<Real, 9> rotation_matrix(Real w, Real x, Real y, Real z) {
  const Real largest = std::max({std::abs(w), std::abs(x), std::abs(y), std::abs(z), Real(1e-30)});
  w /= largest, x /= largest, y /= largest, z /= largest;
  const Real length = std::sqrt(w * w + x * x + y * y + z * z);
  const Real scale = Real(1) / std::max(length, Real(1e-12) / largest);
  w *= scale, x *= scale, y *= scale, z *= scale;
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

/// A Gaussian's projection. The falloff at offset (dx, dy) from the mean is exp(-q / 2) with
///   q = (l1 dx + l2 dy)^2 + (l3 dy)^2,
/// the Cholesky form of q = d^T conic d. Written so, the cancellation along a needle happens before squaring: the
/// expanded form loses a tenth of a sigma in float on a splat 1000 pixels long, this one nothing that shows.
template <std::floating_point Real>
struct Projection {
  bool visible = false;  ///< In front of the near plane, and numbers that float can hold. All else is 0 otherwise.
  Real x = 0, y = 0;     ///< Mean, pixel-index units.
  Real depth = 0;        ///< Along the optical axis, world units.
  Real sigma_x = 0, sigma_y = 0;  ///< Standard deviations of the marginals, pixels, low pass included.
  Real covariance_xy = 0;         ///< Pixels^2.
  Real l1 = 0, l2 = 0, l3 = 0;    ///< 1 / pixels.
};

template <std::floating_point Real>
Projection<Real> project(const ViewParams<Real>& view, std::array<Real, 3> mean, std::array<Real, 3> log_scale,
                         std::array<Real, 4> rotation_wxyz) {
  Projection<Real> out;
  std::array<Real, 3> d;
  for (std::size_t i = 0; i < 3; ++i) d[i] = (mean[i] - view.centre_high[i]) - view.centre_low[i];
  std::array<Real, 3> p;
  for (std::size_t i = 0; i < 3; ++i)
    p[i] = view.rotation[3 * i] * d[0] + view.rotation[3 * i + 1] * d[1] + view.rotation[3 * i + 2] * d[2];
  if (!(p[2] > Real(near_plane))) return out;  // also when it is NaN
  const Real x_over_z = p[0] / p[2], y_over_z = p[1] / p[2];
  out.x = view.fx * x_over_z + view.cx;
  out.y = view.fy * y_over_z + view.cy;
  constexpr Real far_away = Real(1e18);  // its square still fits a float
  if (!(std::abs(out.x) < far_away && std::abs(out.y) < far_away && p[2] < far_away)) return Projection<Real>{};

  // Jacobian of the projection at the clamped point, times cam_from_world: two rows of 3.
  const Real jx = view.fx / p[2], jy = view.fy / p[2];
  const Real tx = std::clamp(x_over_z, view.min_x_over_z, view.max_x_over_z);
  const Real ty = std::clamp(y_over_z, view.min_y_over_z, view.max_y_over_z);
  const auto r = rotation_matrix(rotation_wxyz[0], rotation_wxyz[1], rotation_wxyz[2], rotation_wxyz[3]);
  std::array<Real, 3> u, v;  // rows of J R_view R S: covariance = [u.u, u.v; u.v, v.v] + low pass
  for (std::size_t j = 0; j < 3; ++j) {
    const Real sigma = std::exp(std::clamp(log_scale[j], Real(-max_log_scale), Real(max_log_scale)));
    std::array<Real, 3> axis;  // the local axis j in camera space, one sigma long
    for (std::size_t i = 0; i < 3; ++i)
      axis[i] =
          (view.rotation[3 * i] * r[j] + view.rotation[3 * i + 1] * r[3 + j] + view.rotation[3 * i + 2] * r[6 + j]) *
          sigma;
    u[j] = jx * (axis[0] - tx * axis[2]);
    v[j] = jy * (axis[1] - ty * axis[2]);
  }
  // In units of the largest entry, so that the determinant of a splat 1e12 pixels wide does not overflow.
  Real unit = 1;
  for (std::size_t j = 0; j < 3; ++j) unit = std::max({unit, std::abs(u[j]), std::abs(v[j])});
  for (std::size_t j = 0; j < 3; ++j) u[j] /= unit, v[j] /= unit;
  const Real low_pass = Real(low_pass_px2) / (unit * unit);
  const Real uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
  const Real uv = u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
  const Real vv = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
  // Lagrange: uu vv - uv^2 = |u x v|^2, without the cancellation that makes a needle's determinant negative.
  const Real cx = u[1] * v[2] - u[2] * v[1], cy = u[2] * v[0] - u[0] * v[2], cz = u[0] * v[1] - u[1] * v[0];
  const Real determinant = (cx * cx + cy * cy + cz * cz) + low_pass * (uu + vv) + low_pass * low_pass;
  const Real yy = vv + low_pass;
  out.visible = true;
  out.depth = p[2];
  out.sigma_x = unit * std::sqrt(uu + low_pass);
  out.sigma_y = unit * std::sqrt(yy);
  out.covariance_xy = unit * unit * uv;
  out.l1 = std::sqrt(yy / determinant) / unit;
  out.l2 = -out.l1 * uv / yy;
  out.l3 = 1 / out.sigma_y;
  return out;
}

/// Opacity of a stored logit.
template <std::floating_point Real>
Real opacity(Real logit) {
  return 1 / (1 + std::exp(-std::clamp(logit, Real(-max_opacity_logit), Real(max_opacity_logit))));
}

/// Colour of a Gaussian seen from the camera: max(0, 0.5 + sum_k sh_k Y_k(direction)), one value per channel.
///   sh  [3][(degree_stored + 1)^2]; bands above `degree` are ignored
template <std::floating_point Real>
std::array<Real, 3> color(const ViewParams<Real>& view, std::array<Real, 3> mean, std::span<const float> sh,
                          int degree) {
  std::array<Real, 3> d;
  for (std::size_t i = 0; i < 3; ++i) d[i] = (mean[i] - view.centre_high[i]) - view.centre_low[i];
  const Real length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  std::array<Real, 16> basis;
  scene::sh_basis(degree, d[0] / length, d[1] / length, d[2] / length, basis.data());
  const std::size_t stored = sh.size() / 3, used = std::size_t(degree + 1) * std::size_t(degree + 1);
  std::array<Real, 3> rgb;
  for (std::size_t c = 0; c < 3; ++c) {
    Real sum = Real(0.5);
    for (std::size_t k = 0; k < used; ++k) sum += Real(sh[c * stored + k]) * basis[k];
    rgb[c] = sum > 0 ? std::min(sum, Real(max_color)) : Real(0);  // NaN, from inf - inf, becomes 0
  }
  return rgb;
}

}  // namespace engine::render
