// One splat at one pixel: its alpha and its place in the ray's sum, and the pullbacks of both, in plain numbers.
// Source: Kerbl et al. 2023, eqs. 2-3. The kernels (simd/composite_tile.cc, simd/composite_tile_vjp.cc) have forms of
// their own, made for their inner loops: 2^x in place of e^x, and dL/dT in place of `behind`.
#pragma once

#include <algorithm>

#include "engine/render/project_vjp.h"

namespace engine::render {

/// A splat's falloff at a pixel. Blended where alpha >= min_alpha.
template <std::floating_point Real>
struct Falloff {
  Real along, across;  ///< K d: (l1 dx + l2 dy, l3 dy), standard deviations.
  Real raw;            ///< opacity * exp(-(along^2 + across^2) / 2)
  Real alpha;          ///< min(max_alpha, raw)
};

///   dx, dy  from the splat's mean to the pixel's centre, pixels
template <std::floating_point Real>
Falloff<Real> falloff(const Projection<Real>& splat, Real opacity, Real dx, Real dy) {
  Falloff<Real> out;
  out.along = splat.l1 * dx + splat.l2 * dy;
  out.across = splat.l3 * dy;
  out.raw = opacity * std::exp(Real(-0.5) * (out.along * out.along + out.across * out.across));
  out.alpha = std::min(Real(max_alpha), out.raw);
  return out;
}

/// What the clamp of alpha at 0.99 does to a gradient.
enum class AlphaClamp {
  exact,             ///< Its derivative: nothing passes at 0.99. What we optimise with.
  straight_through,  ///< Passes as if nothing had been clamped (INRIA's backward pass). Reference backend only.
};

/// dL/d(splat), summed over its pixels. With g = raw dL/draw and e = (along, across), the sums of g, g e and g e e^T
/// hold all that the splat's opacity, mean and shape need, and none of them cancels in a long needle.
template <std::floating_point Real>
struct SplatGradient {
  Real g = 0, along = 0, across = 0;
  Real along_along = 0, along_across = 0, across_across = 0;
  std::array<Real, 3> color{};
  Real depth = 0;
};

/// Pullback of falloff(), added to v_splat. At the clamp itself the derivative is that of the clamped side: zero.
template <std::floating_point Real, std::floating_point Sum>
void falloff_vjp(const Falloff<Real>& at, Real v_alpha, AlphaClamp clamp, SplatGradient<Sum>& v_splat) {
  if (clamp == AlphaClamp::exact && at.alpha >= Real(max_alpha)) return;
  const Real g = at.raw * v_alpha;
  v_splat.g += g;
  v_splat.along += g * at.along;
  v_splat.across += g * at.across;
  v_splat.along_along += g * at.along * at.along;
  v_splat.along_across += g * at.along * at.across;
  v_splat.across_across += g * at.across * at.across;
}

/// dL/d(projection) from a splat's sums.
template <std::floating_point Real>
ProjectionGradient<Real> projection_gradient(const Projection<Real>& splat, const SplatGradient<Real>& v_splat) {
  return {.x = splat.l1 * v_splat.along,
          .y = splat.l2 * v_splat.along + splat.l3 * v_splat.across,
          .depth = v_splat.depth,
          .strain_11 = v_splat.along_along,
          .strain_12 = v_splat.along_across,
          .strain_22 = v_splat.across_across};
}

/// dL/dlogit from a splat's sums: opacity dL/dopacity is the sum of g.
template <std::floating_point Real>
Real opacity_logit_gradient(Real logit, const SplatGradient<Real>& v_splat) {
  return logit_vjp(logit, v_splat.g);
}

/// A ray walked back to front. Starts behind the last blended splat, with the transmittance that is left there, and
///   behind = transmittance * dL/dtransmittance, where dL/dtransmittance = background . v_color - v_alpha.
template <std::floating_point Real>
struct RayBackward {
  Real transmittance;
  Real behind;  ///< Sum of weight * v_weight over all that lies farther back.
};

/// One step towards the eye: the pullback of blending a splat with weight = T alpha, T <- T (1 - alpha).
///   v_weight  dL/dweight: color . v_color + depth * v_depth
///   returns   dL/dalpha; needs alpha < 1
/// Recovers T by division: of a ray, only its end is kept.
template <std::floating_point Real>
Real blend_vjp(Real alpha, Real v_weight, RayBackward<Real>& ray) {
  const Real keep = 1 - alpha;
  ray.transmittance /= keep;
  const Real v_alpha = ray.transmittance * v_weight - ray.behind / keep;
  ray.behind += ray.transmittance * alpha * v_weight;
  return v_alpha;
}

}  // namespace engine::render
