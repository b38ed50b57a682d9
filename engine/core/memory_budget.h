// Memory that several threads may take for a while, counted before it is allocated.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <set>
#include <string>
#include <utility>

#include "engine/core/result.h"

namespace engine {

/// A number of bytes that are lent, first come, first served: a large request is not passed by small ones for ever. It
/// allocates nothing; whoever takes a share says how much memory the work at hand takes, and holds the share as long.
/// Safe to call from any thread.
class MemoryBudget {
 public:
  using Milliseconds = std::chrono::milliseconds;

  /// bytes     lent at a time; 0: no limit
  /// name      of the limit in messages: "--work-memory"
  /// patience  longest wait for a share
  explicit MemoryBudget(std::uint64_t bytes, std::string name = "the memory for work",
                        Milliseconds patience = Milliseconds(10'000))
      : bytes_(bytes), name_(std::move(name)), patience_(patience) {}

  /// Bytes that are lent as long as this lives; the budget outlives it. By default, none.
  class Share {
   public:
    Share() = default;
    Share(MemoryBudget& budget, std::uint64_t bytes) : budget_(&budget), bytes_(bytes) {}
    Share(Share&& other) noexcept
        : budget_(std::exchange(other.budget_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}
    Share& operator=(Share&& other) noexcept {
      std::swap(budget_, other.budget_), std::swap(bytes_, other.bytes_);
      return *this;
    }
    ~Share() {
      if (budget_) budget_->give_back(bytes_);
    }

   private:
    MemoryBudget* budget_ = nullptr;
    std::uint64_t bytes_ = 0;
  };
  /// Waits until so many bytes are free. A thread that holds a share and asks for another may wait for others that do
  /// the same, but never for longer than the patience.
  ///   where   address of what needs them, for errors
  ///   errors  too_large: it is more than the whole budget; unavailable: others had it for too long
  [[nodiscard]] Result<Share> take(std::uint64_t bytes, const std::string& where);

  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }  ///< 0: no limit.
  [[nodiscard]] std::uint64_t lent() const;

 private:
  void give_back(std::uint64_t bytes);

  const std::uint64_t bytes_;
  const std::string name_;
  const Milliseconds patience_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t lent_ = 0;
  std::uint64_t next_ticket_ = 0;
  std::set<std::uint64_t> waiting_;  ///< Tickets; the first comes first.
};

/// A share of a budget that there may be.
///   budget  null: there is none, and all is given
[[nodiscard]] inline Result<MemoryBudget::Share> take_from(MemoryBudget* budget, std::uint64_t bytes,
                                                           const std::string& where) {
  if (budget == nullptr) return MemoryBudget::Share();
  return budget->take(bytes, where);
}

}  // namespace engine
