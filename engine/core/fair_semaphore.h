// A counting semaphore whose waiting line is fair and bounded.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "engine/core/result.h"

namespace engine {

/// First come, first served. Safe to call from any thread.
class FairSemaphore {
 public:
  struct Limits {
    int slots = 1;                                                     ///< Holders at a time, from 1.
    std::size_t waiting = std::numeric_limits<std::size_t>::max();     ///< Longest waiting line.
    std::optional<std::chrono::milliseconds> patience = std::nullopt;  ///< Longest wait; none: until it is one's turn.
  };
  ///   what  is waited for, in messages: "pictures"
  FairSemaphore(Limits limits, std::string what) : limits_(limits), what_(std::move(what)) {}

  /// One slot, held as long as this lives; the semaphore outlives it.
  class Slot {
   public:
    explicit Slot(FairSemaphore& semaphore) : semaphore_(&semaphore) {}
    Slot(Slot&& other) noexcept : semaphore_(std::exchange(other.semaphore_, nullptr)) {}
    Slot& operator=(Slot&&) = delete;
    ~Slot() {
      if (semaphore_) semaphore_->release();
    }

   private:
    FairSemaphore* semaphore_;
  };
  /// Waits for a slot.
  ///   errors  busy: too many wait already; unavailable: others had it for too long
  [[nodiscard]] Result<Slot> acquire();

  /// How many wait for a slot.
  [[nodiscard]] std::size_t waiting() const;
  /// How often those who waited have been woken so far, all of them together: once a turn.
  [[nodiscard]] std::uint64_t wakes() const;

 private:
  /// One who waits. Each has a condition of its own: woken together, dozens would run for every slot that one gets.
  struct Waiter {
    std::condition_variable served;
    bool has_slot = false;
  };

  [[nodiscard]] bool wait_for_slot(std::unique_lock<std::mutex>& lock);
  void release();

  const Limits limits_;
  const std::string what_;
  mutable std::mutex mutex_;  ///< Guards what follows, and what waiters have.
  int taken_ = 0;             ///< Slots that are held, or have been handed to one who waits.
  std::deque<Waiter*> line_;  ///< The first comes next.
  std::uint64_t wakes_ = 0;
};

}  // namespace engine
