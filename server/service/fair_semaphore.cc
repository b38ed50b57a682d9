#include "server/service/fair_semaphore.h"

namespace server::service {

engine::Result<FairSemaphore::Slot> FairSemaphore::acquire() {
  std::unique_lock lock(mutex_);
  const bool must_wait = taken_ == slots_ || now_serving_ != next_ticket_;
  if (must_wait && next_ticket_ - now_serving_ >= max_waiting_)
    return engine::fail(engine::ErrorCode::busy, "too many pictures are asked for at once: try again in a second");
  const std::uint64_t ticket = next_ticket_++;
  changed_.wait(lock, [&] { return taken_ < slots_ && now_serving_ == ticket; });
  ++now_serving_;
  ++taken_;
  changed_.notify_all();  // there may be a slot for the next one, too
  return Slot(*this);
}

void FairSemaphore::release() {
  {
    const std::lock_guard lock(mutex_);
    --taken_;
  }
  changed_.notify_all();
}

std::size_t FairSemaphore::waiting() const {
  const std::lock_guard lock(mutex_);
  return std::size_t(next_ticket_ - now_serving_);
}

}  // namespace server::service
