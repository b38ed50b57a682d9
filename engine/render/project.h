// One Gaussian through one camera, in plain numbers: for the reference pass, for tests, and for whoever asks about
// single Gaussians. The formulas are those of projection.inc, which the vector kernels share. Source: Zwicker et al.
// 2001, "EWA volume splatting", eqs. 24-31; Kerbl et al. 2023, section 4 and eqs. 5-6.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <span>

#include "engine/render/numbers.h"
#include "engine/scene/camera.h"
#include "engine/scene/sh.h"

namespace engine::render {

constexpr double near_plane = 0.2;    ///< World units along the optical axis: at or before this, a Gaussian is dropped.
constexpr double low_pass_px2 = 0.3;  ///< Added to the diagonal of a 2D covariance: no splat is thinner than a pixel.
constexpr double fov_margin = 0.3;    ///< The Jacobian is evaluated at most this many half fields of view outside.
constexpr double max_alpha = 0.99;    ///< One splat never hides all that lies behind it.
constexpr double min_alpha = 1.0 / 255.0;   ///< Less than one 8-bit step: not blended.
constexpr double min_transmittance = 1e-4;  ///< A ray ends before it would fall below this.
constexpr double far_away = 1e18;  ///< World units or pixels: what is as far is not drawn. Its square fits a float.
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

/// The camera's parameters, as formulas that compute in Real read them.
template <Number Real>
using View = ViewParams<Real>;

#include "engine/render/projection.inc"

/// Rotation matrix (row-major, world_from_local) of a quaternion (w, x, y, z) of any length; of zero, the identity.
template <std::floating_point Real>
std::array<Real, 9> rotation_matrix(Real w, Real x, Real y, Real z) {
  return rotation_matrix(unit_quaternion<Real>({w, x, y, z}));
}

/// A Gaussian's projection.
template <std::floating_point Real>
struct Projection {
  bool visible = false;  ///< In front of the near plane, and numbers that float can hold. All else is 0 otherwise.
  Real x = 0, y = 0;     ///< Mean, pixel-index units.
  Real depth = 0;        ///< Along the optical axis, world units.
  Real sigma_x = 0, sigma_y = 0;  ///< Standard deviations of the marginals, pixels, low pass included.
  Real covariance_xy = 0;         ///< Pixels^2.
  Real l1 = 0, l2 = 0, l3 = 0;    ///< 1 / pixels: see FalloffMatrix.
};

///   mean           world units
///   log_scale      logarithms of the standard deviations along the local axes, world units
///   rotation_wxyz  world_from_local, of any length
template <std::floating_point Real>
Projection<Real> project(const ViewParams<Real>& view, std::array<Real, 3> mean, std::array<Real, 3> log_scale,
                         std::array<Real, 4> rotation_wxyz) {
  const Vector<Real> p = to_camera(view, from_centre(view, mean));
  if (!(p[2] > Real(near_plane))) return {};  // also when it is NaN
  const Perspective<Real> at = perspective(view, p);
  Projection<Real> out;
  out.x = pixel_x(view, at), out.y = pixel_y(view, at), out.depth = p[2];
  const Real far = Real(far_away);
  if (!(abs(out.x) < far && abs(out.y) < far && out.depth < far)) return {};

  const auto r = rotation_matrix(unit_quaternion(rotation_wxyz));
  Vector<Real> u, v;  // rows of J W R S, pixels
  for (std::size_t j = 0; j < 3; ++j) {
    const Real sigma = scale(log_scale[j]);
    const auto [u_j, v_j] = on_picture(at, at.jx * sigma, at.jy * sigma, axis_in_camera(view, r, j));
    u[j] = u_j, v[j] = v_j;
  }
  const Covariance<Real> cov = covariance(u, v);
  const FalloffMatrix<Real> K = falloff_matrix(cov, Real(1));
  out.visible = true;
  out.sigma_x = cov.unit * sqrt(cov.uu + cov.low_pass), out.sigma_y = cov.unit * sqrt(cov.yy);
  out.covariance_xy = cov.unit * cov.unit * cov.uv;
  out.l1 = K.l1, out.l2 = K.l2, out.l3 = K.l3;
  return out;
}

/// Opacity of a stored logit: 1 / (1 + exp(-logit)).
template <std::floating_point Real>
Real opacity(Real logit) {
  return clearness(-logit);
}

/// Colour of a Gaussian seen from the camera: max(0, 0.5 + sum_k sh_k Y_k(direction)), one value per channel.
///   sh  [3][(degree_stored + 1)^2]; bands above `degree` are ignored
template <std::floating_point Real>
std::array<Real, 3> color(const ViewParams<Real>& view, std::array<Real, 3> mean, std::span<const float> sh,
                          int degree) {
  const auto [x, y, z] = direction(from_centre(view, mean)).to;
  std::array<Real, 16> basis;
  scene::sh_basis(degree, x, y, z, basis.data());
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
