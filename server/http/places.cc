#include "server/http/places.h"

namespace server::http {

Places::Place::Place(Places& places, std::string network) : places_(places), network_(std::move(network)) {
  {
    const std::lock_guard lock(places_.mutex_);
    ++places_.by_network_[network_];  // first: it may be out of memory, and nobody would take back what was counted
    ++places_.taken_;
  }
  places_.count_(1);
}

Places::Place::~Place() {
  places_.count_(-1);
  const std::lock_guard lock(places_.mutex_);
  const auto found = places_.by_network_.find(network_);
  if (--found->second == 0) places_.by_network_.erase(found);
  // Told under the lock: whoever waits for this may end the places next.
  if (--places_.taken_ == 0) places_.changed_.notify_all();
}

std::size_t Places::taken() const {
  const std::lock_guard lock(mutex_);
  return taken_;
}

std::size_t Places::taken_by(const std::string& network) const {
  const std::lock_guard lock(mutex_);
  const auto found = by_network_.find(network);
  return found == by_network_.end() ? 0 : found->second;
}

bool Places::empty_within(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, timeout, [this] { return taken_ == 0; });
}

}  // namespace server::http
