// The real spherical harmonics in which a 3D Gaussian scene stores its view-dependent colour.
// Source: Ramamoorthi and Hanrahan 2001 for the functions; order and signs are those of 3DGS files (Kerbl et al. 2023).
#pragma once

#include <array>
#include <concepts>

namespace engine::scene {

/// Y_0 = 1 / (2 sqrt(pi)): a Gaussian of degree 0 has the colour 0.5 + sh_c0 * sh[c][0].
constexpr double sh_c0 = 0.28209479177387814;

/// The (degree + 1)^2 basis values Y_k(d), coefficient order of the files.
///   degree   0..3
///   x, y, z  the direction d, of unit length: from the camera centre to the Gaussian's mean, world axes
///   out      room for (degree + 1)^2 values; those beyond stay as they are
/// The colour of a Gaussian in channel c is max(0, 0.5 + sum_k sh[c][k] Y_k(d)).
template <std::floating_point Real>
constexpr void sh_basis(int degree, Real x, Real y, Real z, Real* out) noexcept {
  out[0] = Real(sh_c0);
  if (degree < 1) return;
  constexpr Real c1 = Real(0.4886025119029199);
  out[1] = -c1 * y;
  out[2] = c1 * z;
  out[3] = -c1 * x;
  if (degree < 2) return;
  const Real xx = x * x, yy = y * y, zz = z * z;
  constexpr Real c2 = Real(1.0925484305920792);
  out[4] = c2 * (x * y);
  out[5] = -c2 * (y * z);
  out[6] = Real(0.31539156525252005) * (2 * zz - xx - yy);
  out[7] = -c2 * (x * z);
  out[8] = Real(0.5462742152960396) * (xx - yy);
  if (degree < 3) return;
  constexpr Real c3_outer = Real(0.5900435899266435), c3_inner = Real(0.4570457994644658);
  out[9] = -c3_outer * y * (3 * xx - yy);
  out[10] = Real(2.890611442640554) * (x * y) * z;
  out[11] = -c3_inner * y * (4 * zz - xx - yy);
  out[12] = Real(0.3731763325901154) * z * (2 * zz - 3 * xx - 3 * yy);
  out[13] = -c3_inner * x * (4 * zz - xx - yy);
  out[14] = Real(1.445305721320277) * z * (xx - yy);
  out[15] = -c3_outer * x * (xx - 3 * yy);
}

/// Pullback of sh_basis(), with x, y and z taken as free variables: that they are a direction is for the caller to add.
///   v_basis  [(degree + 1)^2], dL/dY_k
///   returns  dL/d(x, y, z)
template <std::floating_point Real>
constexpr std::array<Real, 3> sh_basis_vjp(int degree, Real x, Real y, Real z, const Real* v_basis) noexcept {
  std::array<Real, 3> v{};
  if (degree < 1) return v;
  const Real* b = v_basis;
  constexpr Real c1 = Real(0.4886025119029199);
  v = {-c1 * b[3], -c1 * b[1], c1 * b[2]};
  if (degree < 2) return v;
  constexpr Real c2 = Real(1.0925484305920792), c2_zz = Real(0.31539156525252005), c2_xx = Real(0.5462742152960396);
  v[0] += c2 * (y * b[4] - z * b[7]) - 2 * c2_zz * x * b[6] + 2 * c2_xx * x * b[8];
  v[1] += c2 * (x * b[4] - z * b[5]) - 2 * c2_zz * y * b[6] - 2 * c2_xx * y * b[8];
  v[2] += c2 * (-y * b[5] - x * b[7]) + 4 * c2_zz * z * b[6];
  if (degree < 3) return v;
  const Real xx = x * x, yy = y * y, zz = z * z;
  constexpr Real c3_outer = Real(0.5900435899266435), c3_inner = Real(0.4570457994644658),
                 c3_xyz = Real(2.890611442640554), c3_zzz = Real(0.3731763325901154), c3_zxx = Real(1.445305721320277);
  v[0] += -c3_outer * (6 * x * y * b[9] + 3 * (xx - yy) * b[15]) +
          c3_inner * (2 * x * y * b[11] - (4 * zz - 3 * xx - yy) * b[13]) + c3_xyz * y * z * b[10] -
          6 * c3_zzz * x * z * b[12] + 2 * c3_zxx * x * z * b[14];
  v[1] += -c3_outer * (3 * (xx - yy) * b[9] - 6 * x * y * b[15]) +
          c3_inner * (2 * x * y * b[13] - (4 * zz - xx - 3 * yy) * b[11]) + c3_xyz * x * z * b[10] -
          6 * c3_zzz * y * z * b[12] - 2 * c3_zxx * y * z * b[14];
  v[2] += -8 * c3_inner * z * (y * b[11] + x * b[13]) + c3_xyz * x * y * b[10] +
          c3_zzz * (6 * zz - 3 * xx - 3 * yy) * b[12] + c3_zxx * (xx - yy) * b[14];
  return v;
}

}  // namespace engine::scene
