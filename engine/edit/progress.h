// Where a running edit is: what it tells its observer, and how long each stage took.
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <vector>

#include "engine/core/result.h"
#include "engine/edit/observer.h"
#include "engine/edit/plan.h"
#include "engine/edit/report.h"

namespace engine::edit {

/// Follows an edit along its plan. Stages of the same name (one per interval) are summed in times(). For one thread.
class ProgressMeter {
 public:
  ///   work   of the whole edit, whose plan is followed
  ///   times  of an edit that goes on: what its stages have taken so far
  ProgressMeter(const Observer& observer, const Workload& work, std::vector<StageTime> times = {});

  /// What the plan has up to the end of this interval was done before.
  void go_on_after(int interval);
  /// The stage before ends here, and the next one of this kind in the plan begins. Stages of the plan that are passed
  /// over count as done: the edit found nothing to do there.
  ///   interval  1 to T, or the last one that is finished; 0: before the first
  ///   errors    cancelled: a stop was requested
  [[nodiscard]] Result<void> enter(Stage stage, int interval);
  /// Still in the same stage, of which this part is done, 0 to 1.
  ///   iteration, loss  as in Progress
  [[nodiscard]] Result<void> advance(double part, int iteration = 0, std::optional<double> loss = std::nullopt);
  /// The last stage ends; all is done.
  void finish();

  /// Up to the last stage that has ended.
  [[nodiscard]] const std::vector<StageTime>& times() const { return times_; }

 private:
  [[nodiscard]] Result<void> report(double part);
  void end_stage();

  const Observer& observer_;
  std::vector<PlannedStage> plan_;
  std::vector<double> before_;  ///< Of each stage of the plan: planned seconds of those before it; then of all.
  std::size_t at_ = 0;          ///< The stage of the plan that is being carried out.
  std::size_t next_ = 0;        ///< From where on the next one is looked for.
  std::vector<StageTime> times_;
  Progress progress_;
  bool entered_ = false;  ///< A stage is being carried out.
  std::chrono::steady_clock::time_point since_{};
};

}  // namespace engine::edit
