#include "server/http/guess_brake.h"

#include <algorithm>
#include <functional>

#include "server/http/network.h"

namespace server::http {
std::optional<int> GuessBrake::must_wait(const std::string& address, Clock::time_point now) const {
  const std::lock_guard lock(mutex_);
  const auto found = by_network_.find(network_of(address));
  if (found == by_network_.end() || found->second.until <= now) return std::nullopt;
  return int(std::chrono::ceil<std::chrono::seconds>(found->second.until - now).count());
}

void GuessBrake::count_wrong(const std::string& address, const std::string& token, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  std::erase_if(by_network_, [&](const auto& entry) { return now - entry.second.last >= options_.forgotten_after; });
  const std::string network = network_of(address);
  if (!by_network_.contains(network) && by_network_.size() >= options_.max_addresses)
    by_network_.erase(std::min_element(by_network_.begin(), by_network_.end(),
                                       [](const auto& a, const auto& b) { return a.second.last < b.second.last; }));
  Guesses& guesses = by_network_[network];
  guesses.last = now;
  const std::size_t hash = std::hash<std::string>()(token);
  if (guesses.wrong > 0 && hash == guesses.last_token) return;
  guesses.last_token = hash;
  const int beyond = ++guesses.wrong - options_.free_guesses;
  if (beyond <= 0) return;
  auto wait = options_.first_wait;
  for (int i = 1; i < beyond && wait < options_.longest_wait; ++i) wait *= 2;
  guesses.until = now + std::min(wait, options_.longest_wait);
}

void GuessBrake::forget(const std::string& address) {
  const std::lock_guard lock(mutex_);
  by_network_.erase(network_of(address));
}

std::size_t GuessBrake::addresses() const {
  const std::lock_guard lock(mutex_);
  return by_network_.size();
}

}  // namespace server::http
