#include "server/service/fair_gate.h"

namespace server::service {

engine::Result<FairGate::Place> FairGate::enter() {
  std::unique_lock lock(mutex_);
  const bool must_wait = inside_ == places_ || now_serving_ != next_ticket_;
  if (must_wait && next_ticket_ - now_serving_ >= max_waiting_)
    return engine::fail(engine::ErrorCode::busy, "too many pictures are asked for at once: try again in a second");
  const std::uint64_t ticket = next_ticket_++;
  changed_.wait(lock, [&] { return inside_ < places_ && now_serving_ == ticket; });
  ++now_serving_;
  ++inside_;
  changed_.notify_all();  // there may be a place for the next one, too
  return Place(*this);
}

void FairGate::leave() {
  {
    const std::lock_guard lock(mutex_);
    --inside_;
  }
  changed_.notify_all();
}

std::size_t FairGate::waiting() const {
  const std::lock_guard lock(mutex_);
  return std::size_t(next_ticket_ - now_serving_);
}

}  // namespace server::service
