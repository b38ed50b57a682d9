// Where a running edit is: what it tells its observer, how long each stage took, and how long the rest will take.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "engine/core/result.h"
#include "engine/edit/observer.h"
#include "engine/edit/plan.h"
#include "engine/edit/report.h"

namespace engine::edit {

/// Follows an edit along its plan. Stages of the same name (one per interval) are summed in times(). For one thread.
///
/// The time that is left is what the plan says of the stages to come, each multiplied by how many times longer those of
/// its kind have taken so far than they should have. As long as little of a kind was seen, all other kinds count more,
/// and at the very beginning the plan alone.
class ProgressMeter {
 public:
  using Clock = std::function<std::chrono::steady_clock::time_point()>;

  ///   observer  outlives this
  ///   work      of the whole edit, as far as it is known
  ///   times     of an edit that goes on: what its stages have taken so far
  ProgressMeter(const Observer& observer, const Workload& work, std::vector<StageTime> times = {},
                Clock clock = std::chrono::steady_clock::now);

  /// More is known of the same edit: another plan of the same stages.
  void refine(const Workload& work);
  /// As refine(), and only what comes from now on is compared with the plan: so far, the edit was looked at.
  void replan(const Workload& work);
  [[nodiscard]] const Workload& workload() const { return work_; }
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
  /// Nothing has changed, for work that asks more often than there is something to tell. Errors as enter().
  [[nodiscard]] Result<void> go_on() { return report(part_); }
  /// The last stage ends; all is done.
  void finish();

  /// Up to the last stage that has ended.
  [[nodiscard]] const std::vector<StageTime>& times() const { return times_; }

 private:
  /// Stages of a kind, as far as this run has carried them out, seconds.
  struct Done {
    double planned = 0, took = 0;
  };

  [[nodiscard]] Result<void> report(double part);
  void end_stage();
  void add_time(double seconds);
  [[nodiscard]] double seconds_in_stage() const;
  [[nodiscard]] double seconds_left(double part) const;

  const Observer& observer_;
  Clock clock_;
  Workload work_;
  std::vector<PlannedStage> plan_;
  std::vector<double> before_;  ///< Of each stage of the plan: planned seconds of those before it; then of all.
  std::size_t first_ = 0;       ///< The first stage of the plan that this run carries out.
  std::size_t at_ = 0;          ///< The stage of the plan that is being carried out.
  std::size_t next_ = 0;        ///< From where on the next one is looked for.
  std::array<Done, stage_count> done_{};
  std::vector<StageTime> times_;
  Progress progress_;
  bool entered_ = false;  ///< A stage is being carried out.
  double part_ = 0;       ///< Of it, that was told last.
  std::chrono::steady_clock::time_point since_{};
};

}  // namespace engine::edit
