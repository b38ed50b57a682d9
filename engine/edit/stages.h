// Progress, timing and stopping of a running edit.
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "engine/core/result.h"
#include "engine/edit/edit.h"

namespace engine::edit {

/// Tells the observer where the edit is, and writes down how long each stage took. Stages of the same name (one per
/// interval) are summed.
class Stages {
 public:
  Stages(const Observer& observer, std::vector<StageTime>& times) : observer_(observer), times_(times) {}

  ///   iterations  of each interval
  void set_lengths(int intervals, int iterations) {
    progress_.intervals = intervals;
    progress_.iterations = iterations;
  }
  /// The stage before ends here.
  ///   fraction  of the whole edit; never reported as less than before
  ///   errors    cancelled: a stop was requested
  [[nodiscard]] Result<void> enter(const std::string& stage, int interval, double fraction);
  /// Still in the same stage.
  ///   iteration, loss  as in Progress
  [[nodiscard]] Result<void> advance(double fraction, int iteration = 0, std::optional<double> loss = std::nullopt);
  /// The last stage ends; all is done.
  void finish();

 private:
  [[nodiscard]] Result<void> report(double fraction);
  void end_stage();

  const Observer& observer_;
  std::vector<StageTime>& times_;
  Progress progress_;
  std::chrono::steady_clock::time_point since_{};
};

}  // namespace engine::edit
