// Lets a few work at once, the others wait their turn.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <utility>

#include "engine/core/result.h"

namespace server::service {

/// First come, first served. Safe to call from any thread.
class FairGate {
 public:
  /// places   may be inside at once, from 1
  /// waiting  may wait in front of it; more are turned away
  FairGate(int places, std::size_t waiting) : places_(places), max_waiting_(waiting) {}

  /// A place inside, for as long as it lives; the gate outlives it.
  class Place {
   public:
    explicit Place(FairGate& gate) : gate_(&gate) {}
    Place(Place&& other) noexcept : gate_(std::exchange(other.gate_, nullptr)) {}
    Place& operator=(Place&&) = delete;
    ~Place() {
      if (gate_) gate_->leave();
    }

   private:
    FairGate* gate_;
  };
  /// Waits for a place.
  ///   errors  busy: too many wait already
  [[nodiscard]] engine::Result<Place> enter();

  /// How many wait in front of it.
  [[nodiscard]] std::size_t waiting() const;

 private:
  void leave();

  const int places_;
  const std::size_t max_waiting_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  int inside_ = 0;
  std::uint64_t next_ticket_ = 0, now_serving_ = 0;  ///< Those between them wait.
};

}  // namespace server::service
