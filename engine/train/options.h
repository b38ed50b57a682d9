// How changeable Gaussians are trained.
#pragma once

#include <cstddef>

#include "engine/core/result.h"
#include "engine/optim/adam.h"
#include "engine/optim/losses.h"
#include "engine/optim/schedule.h"

namespace engine::train {

/// Which Gaussians get children, and when. Source: Kerbl et al. 2023, section 5.2, with INRIA's numbers.
struct DensifyOptions {
  int every = 100;           ///< Iterations, 0: never.
  double until = 0.6;        ///< Part of a correction after which there are no more: children need time to settle.
  double gradient = 2e-4;    ///< Mean length of dL/d(position in the picture, half pictures) per unit of loss weight.
  double dense = 0.01;       ///< Of the position scale: Gaussians larger than this are split, others cloned.
  double most_growth = 0.5;  ///< Most children, as a part of the rows at the start.
};
[[nodiscard]] Result<void> validate(const DensifyOptions& options);

struct TrainOptions {
  optim::LearningRates rates = {};
  optim::AdamOptions adam = {};
  optim::BackgroundLossOptions background = {};
  double perceptual_weight = 1;      ///< lambda_lpips, 0 or more. Paper: 1.
  double dead_zone = 0.501 / 255.0;  ///< Colour units, 0 or more: see optim::edit_loss().
  DensifyOptions densify = {};
  double floater_distance = 0.1;  ///< Of the radius of the changeable part: see Trainer::step().
  /// Bytes. What views keep of the frozen Gaussians beyond this is let go, of those used last, and made anew
  /// when it is needed: slower by a pass over the scene, the same bytes.
  std::size_t frozen_memory = std::size_t{2} << 30;
};
[[nodiscard]] Result<void> validate(const TrainOptions& options);

}  // namespace engine::train
