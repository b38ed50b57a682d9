// Locks by name: they keep work on the same thing apart without a mutex across it. An edit being accepted for a scene
// and that scene being removed, say.
#pragma once

#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace server::edits {

/// Any number may hold a name together, or one alone, as with a std::shared_mutex for each name. Waiting is fair to
/// whoever wants it alone: once one waits, newcomers queue up behind it. Safe to call from any thread; a thread that
/// holds a name must not lock the same one again.
class NamedLocks {
 public:
  /// Holds the name as long as it lives; the locks outlive it.
  class Lock {
   public:
    Lock(Lock&& other) noexcept
        : locks_(std::exchange(other.locks_, nullptr)), name_(std::move(other.name_)), exclusive_(other.exclusive_) {}
    Lock& operator=(Lock&&) = delete;
    ~Lock() {
      if (locks_) locks_->release(name_, exclusive_);
    }

   private:
    friend class NamedLocks;
    Lock(NamedLocks& locks, std::string name, bool exclusive)
        : locks_(&locks), name_(std::move(name)), exclusive_(exclusive) {}
    NamedLocks* locks_;
    std::string name_;
    bool exclusive_;
  };

  /// Waits until nobody holds the name alone.
  [[nodiscard]] Lock lock_shared(const std::string& name);
  /// Waits until nobody else holds the name.
  [[nodiscard]] Lock lock(const std::string& name);

 private:
  struct Entry {
    int shared = 0, waiting_exclusive = 0;
    bool exclusive = false;
  };
  void release(const std::string& name, bool exclusive);

  std::mutex mutex_;  ///< Guards `entries_`.
  std::condition_variable changed_;
  std::map<std::string, Entry> entries_;  ///< For names that somebody holds or waits for.
};

}  // namespace server::edits
