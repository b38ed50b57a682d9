#include "engine/edit/progress.h"

#include <algorithm>
#include <utility>

namespace engine::edit {

ProgressMeter::ProgressMeter(const Observer& observer, const Workload& work, std::vector<StageTime> times)
    : observer_(observer), plan_(plan_of(work)), before_(plan_.size() + 1, 0.0), times_(std::move(times)) {
  for (std::size_t k = 0; k < plan_.size(); ++k) before_[k + 1] = before_[k] + plan_[k].seconds;
  progress_.intervals = work.intervals;
  progress_.iterations = work.corrections * work.iterations;
}

void ProgressMeter::go_on_after(int interval) {
  const auto last =
      std::find_if(plan_.rbegin(), plan_.rend(), [&](const PlannedStage& entry) { return entry.interval == interval; });
  at_ = next_ = std::size_t(plan_.rend() - last);
}

Result<void> ProgressMeter::enter(Stage stage, int interval) {
  end_stage();
  entered_ = true;
  const auto planned = std::find_if(plan_.begin() + std::ptrdiff_t(next_), plan_.end(), [&](const PlannedStage& entry) {
    return entry.stage == stage && (entry.interval == interval || entry.interval == 0);
  });
  if (planned != plan_.end()) at_ = std::size_t(planned - plan_.begin()), next_ = at_ + 1;
  progress_.stage = stage;
  progress_.interval = interval;
  progress_.iteration = 0;
  progress_.loss.reset();
  since_ = std::chrono::steady_clock::now();
  return report(0);
}

Result<void> ProgressMeter::advance(double part, int iteration, std::optional<double> loss) {
  progress_.iteration = iteration;
  progress_.loss = loss;
  return report(part);
}

void ProgressMeter::finish() {
  end_stage();
  progress_.fraction = 1;
  progress_.iteration = 0;
  progress_.loss.reset();
  if (observer_.progress) observer_.progress(progress_);
}

Result<void> ProgressMeter::report(double part) {
  if (observer_.stop.stop_requested())
    return fail(ErrorCode::cancelled, "the edit was stopped before it was finished; the scene is unchanged");
  const double fraction = (before_[at_] + part * plan_[at_].seconds) / before_.back();
  progress_.fraction = std::clamp(fraction, progress_.fraction, 1.0);
  if (observer_.progress) observer_.progress(progress_);
  return {};
}

void ProgressMeter::end_stage() {
  if (!std::exchange(entered_, false)) return;
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - since_).count();
  const auto known =
      std::find_if(times_.begin(), times_.end(), [&](const StageTime& time) { return time.stage == progress_.stage; });
  if (known != times_.end())
    known->seconds += seconds;
  else
    times_.push_back({progress_.stage, seconds});
}

}  // namespace engine::edit
