#include "engine/edit/stages.h"

#include <algorithm>

namespace engine::edit {

Result<void> Stages::enter(const std::string& stage, int interval, double fraction) {
  end_stage();
  progress_.stage = stage;
  progress_.interval = interval;
  progress_.iteration = 0;
  progress_.loss.reset();
  since_ = std::chrono::steady_clock::now();
  return report(fraction);
}

Result<void> Stages::advance(double fraction, int iteration, std::optional<double> loss) {
  progress_.iteration = iteration;
  progress_.loss = loss;
  return report(fraction);
}

void Stages::finish() {
  end_stage();
  progress_.fraction = 1;
  progress_.iteration = 0;
  progress_.loss.reset();
  if (observer_.progress) observer_.progress(progress_);
}

Result<void> Stages::report(double fraction) {
  if (observer_.stop.stop_requested())
    return fail(ErrorCode::cancelled, "the edit was stopped before it was finished; the scene is unchanged");
  progress_.fraction = std::clamp(fraction, progress_.fraction, 1.0);
  if (observer_.progress) observer_.progress(progress_);
  return {};
}

void Stages::end_stage() {
  if (progress_.stage.empty()) return;
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - since_).count();
  const auto known =
      std::find_if(times_.begin(), times_.end(), [&](const StageTime& time) { return time.stage == progress_.stage; });
  if (known != times_.end())
    known->seconds += seconds;
  else
    times_.push_back({progress_.stage, seconds});
}

}  // namespace engine::edit
