// How many connections are open, and whose.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace server::http {

/// Counts connections by the network they come from. Safe to call from any thread.
class Places {
 public:
  ///   count  told of each change, by +1 or -1
  explicit Places(std::function<void(int)> count) : count_(std::move(count)) {}

  /// One connection's place: counted as long as this lives.
  class Place {
   public:
    Place(Places& places, std::string network);
    ~Place();
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;

    [[nodiscard]] const std::string& network() const { return network_; }

   private:
    Places& places_;
    const std::string network_;
  };

  [[nodiscard]] std::size_t taken() const;
  [[nodiscard]] std::size_t taken_by(const std::string& network) const;
  /// Waits until none is taken; false: some still are after `timeout`.
  [[nodiscard]] bool empty_within(std::chrono::milliseconds timeout);

 private:
  const std::function<void(int)> count_;
  mutable std::mutex mutex_;  ///< Guards what follows.
  std::condition_variable changed_;
  std::map<std::string, std::size_t> by_network_;
  std::size_t taken_ = 0;
};

}  // namespace server::http
