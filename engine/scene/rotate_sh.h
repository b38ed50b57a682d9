// Turns the view-dependent colour of a Gaussian with the Gaussian.
#pragma once

#include <array>
#include <span>

#include "engine/core/vec.h"

namespace engine::scene {

/// The matrices by which a rotation acts on the SH coefficients of bands 1 to 3, in the basis of scene/sh.h:
/// rotated[m] = sum_n band[m * (2 l + 1) + n] * c[n]. Colour seen along d becomes colour seen along rotation * d.
struct ShRotation {
  std::array<double, 9> band1;
  std::array<double, 25> band2;
  std::array<double, 49> band3;
};

/// Exact to rounding: the integrals of Y_m(d) Y_n(rotation^-1 d) over the sphere, by Lebedev's rule of degree 7
/// (26 points; the integrand of band 3 has degree 6).
/// Source: Lebedev 1976, "Quadratures on a sphere".
///   rotation  unit quaternion
[[nodiscard]] ShRotation sh_rotation(const DQuat& rotation);
/// The same of an orthogonal matrix, which may mirror: colour seen along d becomes colour seen along turn * d.
[[nodiscard]] ShRotation sh_rotation(const DMat3& turn);

/// Applies it to the coefficients of one colour channel: coefficients [1, 4, 9 or 16], band 0 stays as it is.
void rotate_sh(const ShRotation& rotation, std::span<float> coefficients);

}  // namespace engine::scene
