#include "server/edits/speed_log.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "engine/core/median.h"

namespace server::edits {
namespace {

using engine::edit::FrameTime;

// All are choices. The slowness of a machine is known once a few edits were estimated, and follows when it changes for
// good; frames of a scene do not change, but each time they are measured something may come between.
constexpr std::size_t slownesses_at_first = 5, slownesses_kept = 31;
constexpr std::size_t times_measured = 3;
constexpr std::size_t pictures_kept = 64;

double median_of(const std::deque<double>& values) {
  return engine::median(std::vector<double>(values.begin(), values.end()));
}

}  // namespace

FrameTime SpeedLog::Frames::median() const { return {engine::median(gaussians), engine::median(pixel)}; }

SpeedLog::SpeedLog(Slowness slowness) : slowness_(std::move(slowness)) {}

void SpeedLog::note_slowness(double slowness) {
  slownesses_.push_back(slowness);
  if (slownesses_.size() > slownesses_kept) slownesses_.pop_front();
}

MachineSpeed SpeedLog::speed_of(const std::string& picture, const std::function<FrameTime()>& frames) {
  bool is_first = false;
  std::optional<FrameTime> known;  // in times of the yardstick; copied: other pictures may push this one out meanwhile
  {
    const std::lock_guard lock(mutex_);
    is_first = slownesses_.empty();
    const auto found = frames_.find(picture);
    if (found != frames_.end() && found->second.gaussians.size() >= times_measured) {
      found->second.last_use = ++uses_;
      known = found->second.median();
    }
  }
  std::vector<double> slownesses;
  for (std::size_t i = 0; i < (is_first ? slownesses_at_first : 1); ++i) slownesses.push_back(slowness_());
  FrameTime frame;
  if (!known) {
    frame = frames();
    slownesses.push_back(slowness_());
  }

  const double now = known ? slownesses.back() : (slownesses[slownesses.size() - 2] + slownesses.back()) / 2;

  const std::lock_guard lock(mutex_);
  for (const double slowness : slownesses) note_slowness(slowness);
  if (!known) {
    Frames& measured = frames_[picture];
    measured.last_use = ++uses_;
    measured.gaussians.push_back(frame.gaussians / now);
    measured.pixel.push_back(frame.pixel / now);
    known = measured.median();
    if (frames_.size() > pictures_kept)
      frames_.erase(std::ranges::min_element(frames_, {}, [](const auto& entry) { return entry.second.last_use; }));
  }
  const double usual = median_of(slownesses_);
  return {{known->gaussians * usual, known->pixel * usual}, usual, now};
}

}  // namespace server::edits
