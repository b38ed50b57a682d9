// How a running edit talks to whoever runs it.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/edit/plan.h"
#include "engine/edit/report.h"
#include "engine/edit/state.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"
#include "engine/scene/overlay.h"

namespace engine::edit {

/// Where a running edit is.
struct Progress {
  int interval = 0;  ///< 1..intervals; 0 before the first.
  int intervals = 0;
  Stage stage = Stage::assign;
  double fraction = 0;                      ///< Of the whole edit, 0..1, never falls.
  std::optional<double> seconds_left = {};  ///< About; nothing as long as nobody has seen how fast this machine is.
  int iteration = 0;                        ///< Done of the interval's optimisation; 0 outside it.
  int iterations = 0;                       ///< Of each interval, all corrections together; 0: nothing is optimised.
  std::optional<double> loss = {};          ///< Of the last iteration, while it optimises.
};

/// The scene at one moment of an interval, for those who want to see it.
struct Moment {
  int interval = 0;
  int intervals = 0;
  /// "before": as the interval found it; "deformed"; "corrected" and "optimised" where they happen.
  std::string name;
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
  const State& state;            ///< From which run() goes on to the same bytes.
};

/// All are optional. An error that one returns ends the edit with it.
struct Observer {
  /// Once, before anything is rendered: the resolved parameters and the Gaussians of each handle are known.
  std::function<void(const Report&)> assigned;
  std::function<void(const Progress&)> progress;
  std::function<Result<void>(const Moment&)> moment;
  std::size_t pictured = 0;  ///< Views that `moment` makes pictures of, the first ones: what its time depends on.
  std::function<Result<void>(const IntervalDone&)> interval_done;
  /// Asked after every interval but the last, and by an edit that goes on after one: end here, with what there is?
  std::function<bool()> keep;
  std::stop_token stop;  ///< Asked between stages and iterations: the edit then ends with ErrorCode::cancelled.
};

}  // namespace engine::edit
