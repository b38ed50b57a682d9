// Step 8, optimise: the Gaussians of M are trained towards what each view should show.
// Source: 3DGS-Drag (ICLR 2025), section 3.4, "Loss Function", eq. 6.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/edit/request.h"
#include "engine/optim/perceptual.h"
#include "engine/repair/repair.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"
#include "engine/train/options.h"
#include "engine/working/working_scene.h"

namespace engine::edit {

/// Bytes: the most that an optimisation keeps of the frozen Gaussians of all views (but one view is always kept).
constexpr std::size_t frozen_memory = train::TrainOptions{}.frozen_memory;

/// How far the optimisation of an interval is.
struct OptimiseProgress {
  double set_up = 1;                ///< Part of the views that are set up, 0 to 1.
  int iteration = 0;                ///< Done, of `iterations`; 0 while the views are set up.
  int iterations = 0;               ///< Of this correction.
  std::optional<double> loss = {};  ///< Of the last iteration.
};

/// What the optimisation is to reach, and what it is to keep.
struct Goal {
  /// I_e of view v, in its size, rounded to 8 bits when it is taken; without a value, what the view shows now.
  std::function<std::optional<scene::Image>(std::size_t v)> picture;
  std::span<const float> trust = {};  ///< As in repair::Corrected; empty: no row is held.
  /// Rows of M that have left a place which a corrector has completed, as far as it can: they do not show. Ascending.
  std::span<const std::uint32_t> gone = {};
};

/// The optimisation after a correction: params.iterations iterations.
/// I_o is the render of the scene as it is, with the rows that may change as the input has them, if it has, and without
/// those that are gone. Only rows of M may change, and of them neither those that are trusted fully nor those that are
/// gone. Children are appended: they
/// inherit handle, parent and mean_at_deform; those of members of P_h are copies, those of seeds seeds, others a trail.
///   masks      per view, dilated; views without a set pixel are left out. If none is left, or no row may change,
///              nothing happens.
///   goal       asked once for each view that is not left out, as it is set up
///   round      names the random choices
///   advance    called after every view that is set up and every iteration; its error ends the optimisation
///   returns    the mean loss over the views of the last epoch; none if nothing happens
///   errors     internal: a value is not finite; `where` names it by the input's row ("gaussian[12].opacity")
/// On an error the working scene is as it was.
[[nodiscard]] Result<std::optional<double>> optimise(
    working::WorkingScene& working, const scene::GaussianCloud& input, std::span<const scene::Camera> views,
    std::span<const scene::Mask> masks, const Goal& goal, const Params& params, const repair::Round& round,
    optim::PerceptualLoss& perceptual, const std::function<Result<void>(const OptimiseProgress&)>& advance);

}  // namespace engine::edit
