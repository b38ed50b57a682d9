// One edit as a job: from a version of a scene to the next one, interval by interval.
#pragma once

#include <spdlog/logger.h>

#include <functional>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/jobs/worker.h"
#include "engine/optim/perceptual.h"
#include "proto/edit_status.h"
#include "server/models/models.h"
#include "server/scenes/scene_store.h"

namespace server::edits {

/// What an edit works with; all of it outlives the job.
struct Workshop {
  scenes::SceneStore& scenes;
  engine::WorkArena& arena;
  spdlog::logger* logger = nullptr;  ///< May be null.
  int pictured_views = 4;            ///< Of each interval.
  /// The loss inside masks of edits that name no network; null: the engine's own.
  engine::optim::PerceptualLoss* perceptual = nullptr;
  /// Is told how long an edit took that has made its version, by stages. Empty: nobody is.
  std::function<void(const std::vector<proto::StageSeconds>&)> timed = {};
  /// Seconds of work, those of earlier runs included, after which an edit ends: with the intervals it has finished, as
  /// if it had been asked to stop, and a warning; without any it has failed. Others wait for it, and its estimate was
  /// far off. 0: never.
  double outlived_seconds = 0;
  const models::Models* models = nullptr;  ///< Null: there are none.
  /// Settles what earlier edits have made (results.h): called before this one's version gets its number.
  std::function<void()> settle_results = [] {};
};

/// Carries out the job whose payload is an edit request with scene and version; its progress is a proto::EditRecord,
/// its result what take_in_result() wants. Goes on after the last checkpoint. Where that cannot be used, it begins
/// again, to the same bytes. The thread is given a low priority by the operating system, for good.
///   errors  those of the engine, with their addresses; of the scene store; no_space, unavailable: a picture or a
///           checkpoint cannot be written; too_large: out of memory, or of time with no interval finished; cancelled:
///           as of JobContext::save_checkpoint()
[[nodiscard]] engine::Result<engine::jobs::JobResult> carry_out(engine::jobs::JobContext& context,
                                                                const Workshop& workshop);

}  // namespace server::edits
