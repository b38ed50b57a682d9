#include "engine/core/fair_semaphore.h"

namespace engine {

Result<FairSemaphore::Slot> FairSemaphore::acquire() {
  std::unique_lock lock(mutex_);
  if (taken_ < limits_.slots) {  // nobody waits: slots are handed on to those who do
    ++taken_;
    return Slot(*this);
  }
  if (line_.size() >= limits_.waiting)
    return fail(ErrorCode::busy, "too many " + what_ + " are asked for at once: try again in a second");
  if (!wait_for_slot(lock))
    return fail(ErrorCode::unavailable, what_ + " that were asked for before took too long: try again soon");
  return Slot(*this);
}

/// Stands in line until a slot is handed over, or for as long as patience lasts.
bool FairSemaphore::wait_for_slot(std::unique_lock<std::mutex>& lock) {
  Waiter waiter;
  line_.push_back(&waiter);
  // Without patience it is not looked at. An optional one GCC 12 takes for uninitialised, under ThreadSanitizer.
  const auto deadline = std::chrono::steady_clock::now() + limits_.patience.value_or(std::chrono::milliseconds::zero());
  while (!waiter.has_slot) {
    if (!limits_.patience) {
      waiter.served.wait(lock);
    } else if (waiter.served.wait_until(lock, deadline) == std::cv_status::timeout && !waiter.has_slot) {
      std::erase(line_, &waiter);
      return false;
    }
    ++wakes_;
  }
  return true;
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

std::uint64_t FairSemaphore::wakes() const {
  const std::lock_guard lock(mutex_);
  return wakes_;
}

}  // namespace engine
