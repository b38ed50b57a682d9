#include "engine/core/memory_budget.h"

namespace engine {
namespace {

std::string in_mib(std::uint64_t bytes) {
  constexpr std::uint64_t mib = std::uint64_t{1} << 20;
  return std::to_string(bytes / mib + (bytes % mib > 0 ? 1 : 0)) + " MiB";
}

}  // namespace

Result<MemoryBudget::Share> MemoryBudget::take(std::uint64_t bytes, const std::string& where) {
  if (bytes_ == 0 || bytes == 0) return Share();
  if (bytes > bytes_)
    return fail(ErrorCode::too_large,
                "this takes about " + in_mib(bytes) + " of memory; the limit (" + name_ + ") is " + in_mib(bytes_),
                where);
  std::unique_lock lock(mutex_);
  const std::uint64_t ticket = next_ticket_++;
  const auto place = waiting_.insert(ticket).first;
  // bytes_ - bytes does not wrap around, as above; lent_ + bytes might.
  const bool granted =
      changed_.wait_for(lock, patience_, [&] { return *waiting_.begin() == ticket && lent_ <= bytes_ - bytes; });
  waiting_.erase(place);
  if (granted) lent_ += bytes;
  lock.unlock();
  changed_.notify_all();  // the next in line may go on, too
  if (!granted)
    return fail(ErrorCode::unavailable,
                "this takes about " + in_mib(bytes) + " of memory, and others have had too much of the " +
                    in_mib(bytes_) + " there are (" + name_ + "): try again later",
                where);
  return Share(*this, bytes);
}

void MemoryBudget::give_back(std::uint64_t bytes) {
  {
    const std::lock_guard lock(mutex_);
    lent_ -= bytes;
  }
  changed_.notify_all();
}

std::uint64_t MemoryBudget::lent() const {
  const std::lock_guard lock(mutex_);
  return lent_;
}

}  // namespace engine
