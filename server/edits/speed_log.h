// How fast this machine is, as a rule: what estimates are made with.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "engine/edit/plan.h"

namespace server::edits {

/// What work takes here, when nothing else goes on.
struct MachineSpeed {
  engine::edit::FrameTime frame = {};  ///< Of one scene.
  double slowness = 1;                 ///< As of engine::edit::Workload.
  double now = 1;                      ///< The same at this moment, whatever else goes on.
};

/// Remembers what was measured, and answers with the medians: what was measured while renders and edits were at work
/// is a few times too slow. A frame is noted as so many times what the yardstick took right before and after it, which
/// the same work has slowed down. Safe to call from any thread.
class SpeedLog {
 public:
  using Slowness = std::function<double()>;

  /// slowness  measures it; usually engine::edit::measured_slowness(), some milliseconds
  explicit SpeedLog(Slowness slowness);

  /// Measures the machine, and the frames if they have not been measured often enough.
  ///   picture  what the frames show, and in which size
  ///   frames   measures them
  [[nodiscard]] MachineSpeed speed_of(const std::string& picture,
                                      const std::function<engine::edit::FrameTime()>& frames);

 private:
  /// Frames of one picture, in times of the yardstick.
  struct Frames {
    std::vector<double> gaussians, pixel;
    std::uint64_t last_use = 0;
    [[nodiscard]] engine::edit::FrameTime median() const;  ///< There has to be one.
  };

  void note_slowness(double slowness);

  const Slowness slowness_;
  std::mutex mutex_;               ///< Guards what follows; never held while something is measured.
  std::deque<double> slownesses_;  ///< The last ones.
  std::map<std::string, Frames> frames_;
  std::uint64_t uses_ = 0;
};

}  // namespace server::edits
