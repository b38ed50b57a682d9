// A counting semaphore whose waiting line is fair and bounded.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
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
  void release();

  const int slots_;
  const std::size_t max_waiting_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  int taken_ = 0;
  std::uint64_t next_ticket_ = 0, now_serving_ = 0;  ///< Tickets between the two wait.
};

}  // namespace server::service
