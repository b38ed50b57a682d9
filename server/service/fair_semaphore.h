// A counting semaphore whose waiting line is fair and bounded.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <utility>

#include "engine/core/result.h"

namespace server::service {

/// First come, first served. Safe to call from any thread.
class FairSemaphore {
 public:
  /// slots    holders at a time, from 1
  /// waiting  longest waiting line; whoever comes beyond it is turned away
  FairSemaphore(int slots, std::size_t waiting) : slots_(slots), max_waiting_(waiting) {}

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
  ///   errors  busy: too many wait already
  [[nodiscard]] engine::Result<Slot> acquire();

  /// How many wait for a slot.
  [[nodiscard]] std::size_t waiting() const;

 private:
  /// One who waits. Each has a condition of its own: woken together, dozens would run for every slot that one gets.
  struct Waiter {
    std::condition_variable served;
    bool has_slot = false;
  };

  void release();

  const int slots_;
  const std::size_t max_waiting_;
  mutable std::mutex mutex_;  ///< Guards what follows, and what waiters have.
  int taken_ = 0;             ///< Slots that are held, or have been handed to one who waits.
  std::deque<Waiter*> line_;  ///< The first comes next.
};

}  // namespace server::service
