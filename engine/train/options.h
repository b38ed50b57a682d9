// Options of the training of an edit's Gaussians.
#pragma once

#include <cstddef>

#include "engine/core/result.h"
#include "engine/optim/adam.h"
#include "engine/optim/losses.h"
#include "engine/optim/schedule.h"

namespace engine::train {

/// Which Gaussians get children, and when. Source: Kerbl et al. 2023, section 5.2. `every`, `gradient` and `dense` have
/// the values of the program published with it; `until` and `most_growth` are choices.
struct DensifyOptions {
  int every = 100;     ///< Iterations between two densifications; 0: there is none.
  double until = 0.6;  ///< Part of a correction after which it ends: children need time to settle.
  /// Mean over views of |dL/d(x, y)| / (sum of the loss weights) from which a row gets a child; x and y are the splat's
  /// position in half pictures.
  double gradient = 2e-4;
  double dense = 0.01;       ///< Part of the position scale: larger Gaussians are split, others cloned.
  double most_growth = 0.5;  ///< Most children, as a part of the rows at the start.
};
[[nodiscard]] Result<void> validate(const DensifyOptions& options);

/// Options of a Trainer.
struct TrainOptions {
  optim::LearningRates rates = {};
  optim::AdamOptions adam = {};
  optim::BackgroundLossOptions background = {};
  double perceptual_weight = 1;  ///< lambda_lpips, 0 or more. Paper: 1.
  /// Colour units, 0 or more: see optim::edit_loss(). Rounding to 8 bits errs by up to 0.5 / 255; 0.501 leaves room for
  /// rounding in float.
  double dead_zone = 0.501 / 255.0;
  DensifyOptions densify = {};
  /// A child is a floater when it stands nearer to a camera than its like did, by more than this part of their radius:
  /// see Trainer::step(). A choice.
  double floater_distance = 0.1;
  /// Bytes that views keep of the frozen Gaussians. Beyond this the views used last let go of theirs and make them anew
  /// when they are needed: slower by a pass over the scene, the same bytes. A choice.
  std::size_t frozen_memory = std::size_t{2} << 30;
};
[[nodiscard]] Result<void> validate(const TrainOptions& options);

}  // namespace engine::train
