// Lets one thread in at a time, and nobody wait for it for long.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <utility>

#include "engine/core/result.h"

namespace server::edits {

/// Safe to call from any thread.
class Turnstile {
 public:
  ///   patience  longest wait
  explicit Turnstile(std::chrono::milliseconds patience) : patience_(patience) {}

  /// Nobody else is let in as long as this lives.
  class Pass {
   public:
    explicit Pass(Turnstile& turnstile) : turnstile_(&turnstile) {}
    Pass(Pass&& other) noexcept : turnstile_(std::exchange(other.turnstile_, nullptr)) {}
    Pass& operator=(Pass&&) = delete;
    ~Pass() {
      if (turnstile_) turnstile_->leave();
    }

   private:
    Turnstile* turnstile_;
  };
  ///   errors  unavailable: others were in it for too long
  [[nodiscard]] engine::Result<Pass> enter() {
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, patience_, [this] { return !taken_; }))
      return engine::fail(engine::ErrorCode::unavailable, "others are being looked at before; try again soon");
    taken_ = true;
    return Pass(*this);
  }

 private:
  void leave() {
    const std::lock_guard lock(mutex_);
    taken_ = false;
    changed_.notify_one();
  }

  const std::chrono::milliseconds patience_;
  std::mutex mutex_;  ///< Guards what follows.
  std::condition_variable changed_;
  bool taken_ = false;
};

}  // namespace server::edits
