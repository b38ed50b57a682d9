#include "server/service/fair_semaphore.h"

namespace server::service {

engine::Result<FairSemaphore::Slot> FairSemaphore::acquire() {
  std::unique_lock lock(mutex_);
  if (taken_ < slots_) {  // nobody waits: slots are handed on to those who do
    ++taken_;
    return Slot(*this);
  }
  if (line_.size() >= max_waiting_)
    return engine::fail(engine::ErrorCode::busy, "too many pictures are asked for at once: try again in a second");
  Waiter waiter;
  line_.push_back(&waiter);
  waiter.served.wait(lock, [&] { return waiter.has_slot; });
  return Slot(*this);
}

void FairSemaphore::release() {
  const std::lock_guard lock(mutex_);
  if (line_.empty()) {
    --taken_;
    return;
  }
  Waiter& next = *line_.front();
  line_.pop_front();
  next.has_slot = true;
  next.served.notify_one();  // under the lock: the waiter, and its condition, may be gone right after it
}

std::size_t FairSemaphore::waiting() const {
  const std::lock_guard lock(mutex_);
  return line_.size();
}

}  // namespace server::service
