// The drag edit, step by step (paper, section 3; here: deformation guidance, masks, views, intervals, relocation).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/correct/corrector.h"
#include "engine/edit/checkpoint.h"
#include "engine/edit/report.h"
#include "engine/edit/request.h"
#include "engine/optim/perceptual.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"
#include "engine/scene/overlay.h"

namespace engine::edit {

/// Where a running edit is.
struct Progress {
  int interval = 0;  ///< 1..intervals; 0 before the first.
  int intervals = 0;
  std::string
      stage;  ///< "assign", "views", "deform", "mask", "correct", "optimise", "relocate", "finish"; for an Observer
              ///< that wants them, "renders" (Observer::moment) and "checkpoint" (Observer::interval_done)
  double fraction = 0;              ///< Of the whole edit, 0..1, never falls.
  int iteration = 0;                ///< Done of the interval's optimisation; 0 outside it.
  int iterations = 0;               ///< Of each interval, all corrections together; 0: nothing is optimised.
  std::optional<double> loss = {};  ///< Of the last iteration, while it optimises.
};

/// The scene at one moment of an interval, for those who want to see it.
struct Moment {
  int interval = 0;
  int intervals = 0;
  std::string
      stage;  ///< "before": as the interval found it; "deformed"; "corrected" and "optimised" where they happen.
  const scene::Overlay& overlay;                ///< Over the input: the scene as it would be published.
  std::span<const scene::Camera> views;         ///< Of the edit, best first.
  std::span<const scene::Image> pictures = {};  ///< "corrected": I_e of each view; else empty: the overlay's are meant.
};

/// One interval is finished.
struct IntervalDone {
  int interval = 0;
  int intervals = 0;
  double seconds = 0;            ///< It took.
  std::optional<double> loss;    ///< Mean over the views of the last epoch of the optimisation, if there was one.
  std::vector<DVec3> positions;  ///< Of the handles, world units.
  const Checkpoint& checkpoint;  ///< From which run() goes on to the same bytes.
};

/// How an edit talks to whoever runs it. All are optional. An error that one returns ends the edit with it.
struct Observer {
  std::function<void(const Progress&)> progress;
  std::function<Result<void>(const Moment&)> moment;
  std::function<Result<void>(const IntervalDone&)> interval_done;
  std::function<bool()> keep;  ///< Asked after every interval but the last: end here, with what there is?
  std::stop_token stop;        ///< Asked between stages and iterations: the edit then ends with ErrorCode::cancelled.
};

struct Outcome {
  scene::Overlay overlay;            ///< Over the input. An empty one: nothing moved.
  bool stopped_early = false;        ///< By Observer::keep, before the last interval.
  std::vector<scene::Camera> views;  ///< Those chosen, best first, scaled to params.max_image_side.
  std::vector<scene::Mask> masks;    ///< Per chosen view, in its size: union over intervals.
  Report report;
};

/// Runs an edit.
///   scene    not changed
///   cameras  the dataset's; empty: virtual ones are made
///   errors   invalid_argument (validate; a camera: `where` is "cameras[3].fx"), unprocessable (a handle without
///   Gaussians: `where` names it), cancelled, internal (a value that is not finite came up while optimising: `where` is
///   "gaussian[12].opacity", by the input's row); those of `perceptual`
/// A drag that moves nothing gives the scene back, byte for byte.
/// Deterministic: same inputs, same bytes, for any number of threads.
///   resume   state after an interval of the same edit: it goes on with the next one; null: from the start. With
///            Observer::keep answering yes at once, it ends with that interval as its result.
///   perceptual  the loss inside masks; null: optim::MsSsimLoss
///   corrector   null: `none`, the optimisation keeps what the deformation shows
[[nodiscard]] Result<Outcome> run(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras,
                                  const Request& request, const Observer& observer = {},
                                  const Checkpoint* resume = nullptr, optim::PerceptualLoss* perceptual = nullptr,
                                  correct::Corrector* corrector = nullptr);

}  // namespace engine::edit
