// How a scene is fitted to photographs.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/optim/adam.h"
#include "engine/optim/losses.h"
#include "engine/optim/schedule.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/train/options.h"

namespace engine::fit {

/// Options of a fit. Iterations, Gaussians and halvings are chosen for a few minutes on a processor: ADR 8.
struct FitOptions {
  int iterations = 7000;                 ///< 1 or more, one view each.
  int sh_degree = scene::max_sh_degree;  ///< 0 to 3. Reached band by band, if there are iterations enough: phase_of().
  std::size_t max_gaussians = 100'000;   ///< 1 or more. Limits growth; a start that is larger stays as large.
  int halvings = 2;                      ///< 0 to 8: photos are first halved so often, then less and less.
  std::uint64_t seed = 0;
  Vec3 background{0.0f};  ///< Colour behind the scene, display-referred.

  optim::LearningRates rates = {};  ///< Positions go by the capture's extent: mask_radii and most_widths are not used.
  optim::AdamOptions adam = {};
  optim::BackgroundLossOptions loss = {.l1_weight = 0.8, .ssim_weight = 0.2, .l1 = {}};  ///< INRIA's weights.
  /// Here `until` is a part of all iterations and `dense` a part of the capture's extent; most_growth is not used.
  train::DensifyOptions densify = {};
  double least_opacity = 0.005;  ///< Fainter Gaussians go when others get children; 0 to below 1. INRIA's.
};

/// errors  invalid_argument: `where` is the option
[[nodiscard]] Result<void> validate(const FitOptions& options);

}  // namespace engine::fit
