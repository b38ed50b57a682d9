// Everything an edit has come to know, as a value.
#pragma once

#include <string>
#include <vector>

#include "engine/core/vec.h"
#include "engine/correct/repainter.h"
#include "engine/edit/report.h"
#include "engine/edit/request.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"
#include "engine/working/working_scene.h"

namespace engine::edit {

/// The state of an edit between two intervals. Each step of an interval takes it from one value to the next; written
/// down, it is the checkpoint (checkpoint.h). Whatever else an edit keeps while it runs can be made anew from the
/// input, the request and this.
struct State {
  int interval = 0;  ///< Finished, 0 to T.
  working::WorkingScene scene;
  std::vector<DVec3> positions;      ///< Of the handles, in the frame of `scene`.
  std::vector<scene::Camera> views;  ///< Chosen, best first, of the world.
  std::vector<scene::Mask> masks;    ///< Per view, in its size: what the part has covered so far, not dilated yet.
  Report report;                     ///< So far.
  /// What a repainter has made of views, oldest first: with the views before the edit, which can be rendered again, it
  /// is the history that it learns from. Of each interval the last correction.
  std::vector<correct::HistoryPicture> history = {};
  std::string repainter = {};   ///< What a repainter has learned (correct::Repainter::state()); empty without one.
  std::string perceptual = {};  ///< Of the perceptual loss (optim::PerceptualLoss::identity()).
};

/// Could an edit of this scene by this request be in this state? Precondition: validate(request).
[[nodiscard]] bool is_of(const scene::GaussianCloud& input, const Request& request, const State& state);

}  // namespace engine::edit
