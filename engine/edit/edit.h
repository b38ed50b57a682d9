// The drag edit: steps 1 to 9, in order (docs/method.md tells them one by one).
// Source: 3DGS-Drag (ICLR 2025), section 3.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/correct/corrector.h"
#include "engine/correct/repainter.h"
#include "engine/edit/observer.h"
#include "engine/edit/report.h"
#include "engine/edit/request.h"
#include "engine/edit/state.h"
#include "engine/optim/perceptual.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"
#include "engine/scene/overlay.h"

namespace engine::edit {

/// What an edit works with; they outlive it.
struct Tools {
  correct::Corrector* corrector =
      nullptr;  ///< Null: `none`, views should show what they show once the part is deformed.
  optim::PerceptualLoss* perceptual = nullptr;  ///< The loss inside masks; null: optim::MsSsimLoss.
  /// Repaints the views once the corrector, which must be there, has completed what is behind the dragged part. Null:
  /// the corrector corrects them. It is used by one edit, from its start, or from restore() where it goes on.
  correct::Repainter* repainter = nullptr;
  RepaintTime repaint_time = {};        ///< Of the repainter, where it is known: progress goes by it.
  double perceptual_pixel_seconds = 0;  ///< Of the perceptual loss, as in Workload.
};

struct Outcome {
  scene::Overlay overlay;            ///< Over the input. An empty one: nothing moved.
  bool stopped_early = false;        ///< By Observer::keep, before the last interval.
  std::vector<scene::Camera> views;  ///< Those chosen, best first, scaled to params.max_image_side.
  std::vector<scene::Mask> masks;    ///< Per chosen view, in its size: union over intervals, dilated.
  Report report;
};

/// Runs an edit.
///   scene    not changed
///   cameras  the dataset's; empty: virtual ones are made
///   from     state after an interval of the same edit (decode()): it goes on with the next one; none: from the start.
///            With Observer::keep answering yes at once, it ends with that interval as its result.
///   errors   invalid_argument (validate; a camera: `where` is "cameras[3].fx"), unprocessable (a handle without
///            Gaussians: `where` names it; nothing would be left: `where` is "handles"), cancelled, internal (a value
///            that is not finite came up while optimising: `where` is "gaussian[12].opacity", by the input's row),
///            conflict (`from` came of other weights, and intervals are left to do: `where` is "checkpoint");
///            those of the tools and of the observer
/// A drag that moves nothing gives the scene back, byte for byte.
/// Deterministic: same inputs, same bytes, for any number of threads, whether it is resumed or not.
[[nodiscard]] Result<Outcome> run(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras,
                                  const Request& request, const Tools& tools = {}, const Observer& observer = {},
                                  std::optional<State> from = std::nullopt);

}  // namespace engine::edit
