// Keeps work on the same thing apart without a mutex across it: an edit being accepted for a scene and that scene being
// removed, a result being published and its edit being cancelled.
#pragma once

#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace server::edits {

/// Any number may share a name, or one may own it. Waiting is fair to owners: once one waits, new sharers queue up
/// behind it. Safe to call from any thread; a thread that holds a name must not ask for the same one again.
class Gate {
 public:
  /// Holds the name as long as it lives; the gate outlives it.
  class Hold {
   public:
    Hold(Hold&& other) noexcept
        : gate_(std::exchange(other.gate_, nullptr)), name_(std::move(other.name_)), owns_(other.owns_) {}
    Hold& operator=(Hold&&) = delete;
    ~Hold() {
      if (gate_) gate_->release(name_, owns_);
    }

   private:
    friend class Gate;
    Hold(Gate& gate, std::string name, bool owns) : gate_(&gate), name_(std::move(name)), owns_(owns) {}
    Gate* gate_;
    std::string name_;
    bool owns_;
  };

  /// Waits until nobody owns the name.
  [[nodiscard]] Hold share(const std::string& name);
  /// Waits until nobody else holds the name.
  [[nodiscard]] Hold own(const std::string& name);

 private:
  struct Use {
    int sharers = 0, waiting_owners = 0;
    bool owned = false;
  };
  void release(const std::string& name, bool owns);

  std::mutex mutex_;  ///< Guards `uses_`.
  std::condition_variable changed_;
  std::map<std::string, Use> uses_;  ///< Of names that somebody holds or waits for.
};

}  // namespace server::edits
