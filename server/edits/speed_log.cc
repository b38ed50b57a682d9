#include "server/edits/speed_log.h"

#include <algorithm>
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

SpeedLog::SpeedLog(Slowness slowness) : slowness_(std::move(slowness)) {}

void SpeedLog::note_slowness(double slowness) {
  slownesses_.push_back(slowness);
  if (slownesses_.size() > slownesses_kept) slownesses_.pop_front();
}

MachineSpeed SpeedLog::speed_of(const std::string& picture, const std::function<FrameTime()>& frames) {
  bool is_first = false, is_known = false;
  {
    const std::lock_guard lock(mutex_);
    is_first = slownesses_.empty();
    const auto found = frames_.find(picture);
    is_known = found != frames_.end() && found->second.gaussians.size() >= times_measured;
  }
  std::vector<double> slownesses;
  for (std::size_t i = 0; i < (is_first ? slownesses_at_first : 1); ++i) slownesses.push_back(slowness_());
  FrameTime frame;
  if (!is_known) {
    frame = frames();
    slownesses.push_back(slowness_());
  }

  const std::lock_guard lock(mutex_);
  for (const double slowness : slownesses) note_slowness(slowness);
  Frames& known = frames_[picture];
  known.last_use = ++uses_;
  if (!is_known) {
    const double now = (slownesses[slownesses.size() - 2] + slownesses.back()) / 2;
    known.gaussians.push_back(frame.gaussians / now);
    known.pixel.push_back(frame.pixel / now);
  }
  const double usual = median_of(slownesses_);
  const MachineSpeed speed{{engine::median(known.gaussians) * usual, engine::median(known.pixel) * usual}, usual};
  if (frames_.size() > pictures_kept)
    frames_.erase(std::ranges::min_element(frames_, {}, [](const auto& entry) { return entry.second.last_use; }));
  return speed;
}

}  // namespace server::edits
