#include "engine/edit/progress.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace engine::edit {
namespace {

// How much of a plan must have been carried out until what was seen of it counts as much as the plan itself. The second
// number says the same of the stages of one kind, which are not all alike: the first view of a correction takes longer
// than the last one. Both were chosen on the edits of docs/estimates.md that are marked `fitted` and on those of the
// fox: docs/experiments/0016-time-left.md.
constexpr double plan_trust = 0.1, kind_trust = 0.4;

bool is_measured(const Workload& work) { return work.frame.gaussians > 0 || work.frame.pixel > 0; }

/// How many times longer than planned it took; `expected` as long as little was carried out, compared with `trusted`.
double slowness(double took, double planned, double expected, double trusted) {
  const double weight = planned + trusted;
  return weight > 0 ? (took + expected * trusted) / weight : expected;
}

}  // namespace

ProgressMeter::ProgressMeter(const Observer& observer, const Workload& work, std::vector<StageTime> times, Clock clock)
    : observer_(observer), clock_(std::move(clock)), times_(std::move(times)) {
  refine(work);
  progress_.intervals = work.intervals;
  progress_.iterations = work.corrections * work.iterations;
}

void ProgressMeter::refine(const Workload& work) {
  work_ = work;
  auto plan = plan_of(work);
  assert(plan_.empty() || plan.size() == plan_.size());
  plan_ = std::move(plan);
  before_.assign(plan_.size() + 1, 0.0);
  for (std::size_t k = 0; k < plan_.size(); ++k) before_[k + 1] = before_[k] + plan_[k].seconds;
}

void ProgressMeter::replan(const Workload& work) {
  refine(work);
  done_ = {};
  if (!entered_) return;
  add_time(seconds_in_stage());
  since_ = clock_();
}

void ProgressMeter::go_on_after(int interval) {
  const auto last =
      std::find_if(plan_.rbegin(), plan_.rend(), [&](const PlannedStage& entry) { return entry.interval == interval; });
  first_ = at_ = next_ = std::size_t(plan_.rend() - last);
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
  since_ = clock_();
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
  progress_.seconds_left = 0;
  progress_.iteration = 0;
  progress_.loss.reset();
  if (observer_.progress) observer_.progress(progress_);
}

Result<void> ProgressMeter::report(double part) {
  part_ = part;
  if (observer_.stop.stop_requested())
    return fail(ErrorCode::cancelled, "the edit was stopped before it was finished; the scene is unchanged");
  if (!observer_.progress) return {};
  const double all = before_.back();
  const double fraction = all > 0 ? (before_[at_] + part * plan_[at_].seconds) / all : 0;
  progress_.fraction = std::clamp(fraction, progress_.fraction, 1.0);
  if (is_measured(work_)) progress_.seconds_left = seconds_left(part);
  observer_.progress(progress_);
  return {};
}

double ProgressMeter::seconds_in_stage() const { return std::chrono::duration<double>(clock_() - since_).count(); }

double ProgressMeter::seconds_left(double part) const {
  std::array<Done, stage_count> done = done_;
  std::array<double, stage_count> of_kind{}, left{};
  if (entered_ && plan_[at_].stage == progress_.stage) {
    Done& present = done[std::size_t(progress_.stage)];
    present.planned += part * plan_[at_].seconds;
    present.took += seconds_in_stage();
  }
  for (std::size_t k = first_; k < plan_.size(); ++k) {
    of_kind[std::size_t(plan_[k].stage)] += plan_[k].seconds;
    if (k >= at_) left[std::size_t(plan_[k].stage)] += (k == at_ ? 1 - part : 1) * plan_[k].seconds;
  }
  Done all;
  for (const Done& kind : done) all.planned += kind.planned, all.took += kind.took;
  const double expected = slowness(all.took, all.planned, 1, plan_trust * (before_.back() - before_[first_]));
  double sum = 0;
  for (std::size_t k = 0; k < stage_count; ++k)
    sum += left[k] * slowness(done[k].took, done[k].planned, expected, kind_trust * of_kind[k]);
  return sum;
}

void ProgressMeter::end_stage() {
  if (!std::exchange(entered_, false)) return;
  const double seconds = seconds_in_stage();
  if (plan_[at_].stage == progress_.stage) {
    done_[std::size_t(progress_.stage)].planned += plan_[at_].seconds;
    done_[std::size_t(progress_.stage)].took += seconds;
  }
  add_time(seconds);
}

void ProgressMeter::add_time(double seconds) {
  const auto known =
      std::find_if(times_.begin(), times_.end(), [&](const StageTime& time) { return time.stage == progress_.stage; });
  if (known != times_.end())
    known->seconds += seconds;
  else
    times_.push_back({progress_.stage, seconds});
}

}  // namespace engine::edit
