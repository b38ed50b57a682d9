// The steps of an edit in their order: each takes the state on, by what stays the same. edit.cc puts them together.
// Source: 3DGS-Drag (ICLR 2025), section 3; docs/method.md tells them one by one.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/correct/corrector.h"
#include "engine/correct/repainter.h"
#include "engine/edit/drag.h"
#include "engine/edit/observer.h"
#include "engine/edit/progress.h"
#include "engine/edit/request.h"
#include "engine/edit/state.h"
#include "engine/optim/perceptual.h"
#include "engine/repair/relight.h"
#include "engine/repair/repair.h"
#include "engine/repair/tinged.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::edit {

using Rows = std::vector<std::uint32_t>;  ///< Of a working scene, ascending.

/// What stays the same while an edit runs; below it, what steps have made of that, and could make again.
struct Edit {
  const scene::GaussianCloud& input;
  const Request& request;
  const Observer& observer;
  optim::PerceptualLoss& perceptual;
  correct::Corrector* corrector;
  correct::Repainter* repainter;
  ProgressMeter progress;
  deform::HandleColumn handle = {};            ///< [N] P_h of every handle, as it was before any row left.
  Parts parts = {};                            ///< How what moves hangs on to what stays.
  Rows given_up = {};                          ///< Crumbs and backing that go away, in the first interval.
  repair::Relit relit = {};                    ///< Rows that the part's shadow leaves or reaches, in that interval.
  repair::Tinged tinged = {};                  ///< Rows around the part that get other colours, in that interval.
  Rows buried = {};                            ///< Rows of the part that no picture shows: they do not arrive.
  std::vector<scene::Camera> candidates = {};  ///< That views are chosen from; they have seen the scene.
  std::optional<repair::Repair> repair = {};   ///< What the unedited scene looks like to a corrector.
  Rows masked_rows = {};                       ///< Those that the masks were last united with.
  std::optional<double> loss = {};             ///< Of the interval at hand: of its last correction that was optimised.

  [[nodiscard]] const Params& params() const { return request.params; }
  /// Step 8 takes place, and so step 7 where there is a corrector.
  [[nodiscard]] bool optimises() const { return params().iterations > 0; }
};

// Each step enters its stage of the plan first. All errors are those of the observer (`cancelled` where a stop was
// requested) and those that are named; after one the state is of no use any more.

/// Steps 1 and 2. Assign: P_h^i, the start of the 3D mask M. Intervals: T, and the handles at their sources.
///   errors  unprocessable: a handle without Gaussians; `where` names it
[[nodiscard]] Result<State> assign_and_divide(Edit& edit);

/// Step 5. Views: chosen from the candidates by what they see of the source and of the fully deformed target. A mask of
/// each, of what vanishes, crumbs and the outskirts of the part, which the candidates tell, and of what its shadow
/// leaves or reaches.
///   cameras  the dataset's; empty: the candidates are virtual
[[nodiscard]] Result<void> look_for_views(State& state, Edit& edit, std::span<const scene::Camera> cameras);

/// Step 3. Deform: from the relocated handles to p_t'(u). Nothing has moved yet.
[[nodiscard]] Result<PlannedMotion> deform(const State& state, Edit& edit, int u);

/// Step 4. Copy and paste. Where a corrector repairs what is torn, copies are drawn out with their surface.
///   returns  the rows of the copies
[[nodiscard]] Result<Rows> paste(State& state, Edit& edit, int u, const PlannedMotion& motion);

/// Step 6. Masks: the pixels that these rows cover join the mask of each view.
[[nodiscard]] Result<void> mask(State& state, Edit& edit, int u, const Rows& rows);

/// The pixels of each view that corrections may change: the masks, dilated.
[[nodiscard]] std::vector<scene::Mask> masks_to_edit(const State& state, const Edit& edit);

/// Before step 7. Fine-tune: a repainter learns from the history of the edit, the views before it and what it has made
/// of them in earlier intervals. Without one nothing happens.
///   errors  those of the repainter
[[nodiscard]] Result<void> tune(State& state, Edit& edit, std::span<const scene::Mask> masks, int u);

/// Step 7. Correct: I_e of each view, and seeds where a surface goes on that nobody has seen. Without a corrector there
/// are no pictures yet; with a repainter they show what is completed, for it to repaint.
///   errors  those of the corrector
[[nodiscard]] Result<repair::Corrected> correct(State& state, Edit& edit, std::span<const scene::Mask> masks,
                                                const repair::Round& round);

/// Step 7 by a repainter: I_e of all views. Those of an interval's last correction join the history.
///   pictures  of correct(), repainted in place
///   errors    those of the repainter
[[nodiscard]] Result<void> repaint(State& state, Edit& edit, std::span<const scene::Mask> masks,
                                   const repair::Round& round, std::vector<scene::Image>& pictures);

/// Step 8. Optimise: M towards the corrected views inside the masks, towards the unedited scene outside.
///   returns  the mean loss over the views of the last epoch; none where nothing may change
///   errors   internal: a value is not finite; `where` names it by the input's row. Those of the perceptual loss
[[nodiscard]] Result<std::optional<double>> optimise(State& state, Edit& edit, std::span<const scene::Mask> masks,
                                                     repair::Corrected corrected, const repair::Round& round);

/// Step 9. Relocate: each handle to where its Gaussians have gone.
[[nodiscard]] Result<void> relocate_handles(State& state, Edit& edit, int u);

/// The plan is made anew once the dragged part is known, and cameras that may look at it: for who watches progress.
void plan_ahead(const State& state, Edit& edit);

/// Shows the scene as it would be published now to an observer that wants to see it.
///   moment  as Moment::name
[[nodiscard]] Result<void> show(const State& state, Edit& edit, int u, const char* moment,
                                std::span<const scene::Image> pictures = {});

}  // namespace engine::edit
