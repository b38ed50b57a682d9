#include "server/edits/record_keeper.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace server::edits {
namespace {

using namespace std::chrono_literals;
using Seconds = std::chrono::duration<double>;

constexpr auto publish_every = 100ms;  // ten pictures a second look alive; each costs a JSON text
constexpr double most_before_the_end = 0.99;

double rounded(double value, double unit) { return std::round(value / unit) * unit; }

}  // namespace

RecordKeeper::RecordKeeper(proto::EditRecord record, Publish publish, Clock clock)
    : record_(std::move(record)),
      publish_(std::move(publish)),
      clock_(std::move(clock)),
      since_(clock_()),
      published_(since_ - publish_every) {
  record_.eta_seconds.reset();
  leave_stage();
}

void RecordKeeper::leave_stage() {
  record_.stage.clear();
  record_.iteration = 0;
  record_.loss.reset();
}

void RecordKeeper::enter(JobStage stage) {
  count_time();
  leave_stage();
  record_.stage = name_of(stage);
  if (stage == JobStage::publish) record_.eta_seconds = rounded(after_seconds_, 0.1);
  publish();
}

void RecordKeeper::advance(const engine::edit::Progress& progress) {
  const bool another_interval = progress.interval != record_.interval;
  record_.interval = progress.interval;
  record_.intervals = progress.intervals > 0 ? progress.intervals : record_.intervals;
  record_.iteration = progress.iteration;
  record_.loss = progress.loss;
  record_.progress = std::max(record_.progress, std::min(rounded(progress.fraction, 1e-4), most_before_the_end));
  if (const std::string_view stage = engine::edit::name_of(progress.stage); stage != record_.stage) {
    count_time();
    record_.stage = stage;
  } else if (!another_interval && clock_() - published_ < publish_every) {
    return;
  }
  if (progress.seconds_left) record_.eta_seconds = rounded(*progress.seconds_left + after_seconds_, 0.1);
  publish();
}

void RecordKeeper::add(proto::FinishedInterval finished) {
  auto& all = record_.finished_intervals;
  const auto at = std::lower_bound(all.begin(), all.end(), finished.interval,
                                   [](const auto& known, int interval) { return known.interval < interval; });
  if (at != all.end() && at->interval == finished.interval) {
    *at = std::move(finished);
  } else {
    all.insert(at, std::move(finished));
  }
}

void RecordKeeper::warn(const std::string& warning) {
  auto& all = record_.warnings;
  if (std::find(all.begin(), all.end(), warning) == all.end()) all.push_back(warning);
}

double RecordKeeper::seconds() {
  count_time();
  double sum = 0;
  for (const proto::StageSeconds& timing : record_.timings) sum += timing.seconds;
  return sum;
}

void RecordKeeper::forget_time() {
  count_time();
  record_.timings.clear();
}

void RecordKeeper::publish() {
  count_time();
  published_ = clock_();
  publish_(proto::to_json(record_));
}

void RecordKeeper::finish() {
  count_time();
  leave_stage();
  record_.eta_seconds.reset();
  record_.progress = 1;
  publish();
}

void RecordKeeper::count_time() {
  const TimePoint now = clock_();
  const double seconds = Seconds(now - since_).count();
  since_ = now;
  if (record_.stage.empty()) return;
  auto& all = record_.timings;
  auto found = std::find_if(all.begin(), all.end(), [&](const auto& timing) { return timing.stage == record_.stage; });
  if (found == all.end()) found = all.insert(all.end(), {record_.stage, 0});
  found->seconds += seconds;
}

}  // namespace server::edits
