// Learning rates: how large, and how they fall.
// Source: Kerbl et al. 2023, "3D Gaussian Splatting for Real-Time Radiance Field Rendering", appendix C and the
// defaults published with it ("INRIA's" below); how they decay within a correction is our choice.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>

#include "engine/core/result.h"

namespace engine::optim {

/// A rate that goes from `initial` at progress 0 to `final` at progress 1, straight in the logarithm. INRIA's position
/// rate does so over the whole training.
///   initial, final  above 0
///   progress        clamped to [0, 1]
[[nodiscard]] inline double exponential_decay(double initial, double final, double progress) {
  assert(initial > 0 && final > 0);
  const double t = std::clamp(progress, 0.0, 1.0);
  return std::exp((1 - t) * std::log(initial) + t * std::log(final));
}

/// Factor on every learning rate at iteration `iteration` (from 0) of the `iterations` of one correction: 1 at the
/// first, `last` at the last, exponential in between, so that a correction ends at rest and the pictures the next one
/// starts from do not depend on where Adam happened to swing.
///   last  the factor at the end, above 0, at most 1; 0.01 is INRIA's ratio of final to initial position rate
[[nodiscard]] inline double decay_within_correction(int iteration, int iterations, double last = 0.01) {
  assert(iteration >= 0 && iteration < iterations);
  if (iterations == 1) return 1;
  return exponential_decay(1, last, double(iteration) / double(iterations - 1));
}

/// Learning rates per parameter, in the parameter's stored form. Defaults: INRIA's, but for mask_radii and
/// most_widths.
struct LearningRates {
  double position = 1.6e-4;      ///< Per unit of position_scale(); dimensionless.
  double sh_dc = 2.5e-3;         ///< SH coefficient 0.
  double sh_rest = 2.5e-3 / 20;  ///< The other SH coefficients.
  double opacity_logit = 0.05;   ///< Logits.
  double log_scale = 5e-3;       ///< Natural logarithm of world units.
  double rotation = 1e-3;        ///< Quaternion components.
  double mask_radii = 5;      ///< c of position_scale(): radii of what is trained that its extent counts as. A choice.
  double most_widths = 0.05;  ///< Largest position rate of a row, in its own widths; may be infinite. A choice.
  double last = 0.01;         ///< Factor of all rates at the end of a correction; above 0, at most 1.
};
[[nodiscard]] Result<void> validate(const LearningRates& rates);

/// The factor of the position rate, world units: min(scene_extent, c * mask_radius). INRIA takes the extent of
/// the whole scene (1.1 times the largest distance of a camera from their centre), at which the Gaussians of a small
/// object in a large scene would jump by their own size at each step.
///   scene_extent  world units; 0 or less: not known, does not limit
///   mask_radius   largest distance of a mean of what is trained from their centre, world units
[[nodiscard]] inline double position_scale(const LearningRates& rates, double scene_extent, double mask_radius) {
  const double of_mask = rates.mask_radii * mask_radius;
  return scene_extent > 0 ? std::min(scene_extent, of_mask) : of_mask;
}

/// Share of the position rate that is a row's, min(1, most_widths * width / rate), of logarithms. With all of it, a
/// small row would jump by its own size at each step, whichever way noise has it, and a surface of many such come
/// apart.
///   log_width       of the row: the second of its three extents (standard deviations), log of world units
///   log_full_width  log of rate / most_widths, from which width on a row has the whole rate; -infinity: all have
[[nodiscard]] inline double share_of_position(double log_width, double log_full_width) {
  return std::exp(std::min(log_width - log_full_width, 0.0));
}

}  // namespace engine::optim
