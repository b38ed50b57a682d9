// How much memory the answers take that clients have not taken yet.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

namespace server::http {

/// A sum of what many hold. Safe to use from any thread.
class UnsentBytes {
 public:
  /// What one holds of it, as long as this lives. Used by one thread at a time.
  class Share {
   public:
    Share() = default;
    ~Share() { change_to(0); }
    Share(const Share&) = delete;
    Share& operator=(const Share&) = delete;

    /// Counted in `sum`, and only there, from now on.
    void set(UnsentBytes& sum, std::uint64_t bytes) {
      if (sum_ != sum.sum_) {
        change_to(0);
        sum_ = sum.sum_;
      }
      change_to(bytes);  // in one step: nobody sees a total without it
    }
    [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

   private:
    void change_to(std::uint64_t bytes) {
      if (sum_) *sum_ += bytes - bytes_;  // modulo 2^64: less, too
      bytes_ = bytes;
    }

    std::shared_ptr<std::atomic<std::uint64_t>> sum_;  // shares may outlive the sum's owner
    std::uint64_t bytes_ = 0;
  };

  [[nodiscard]] std::uint64_t total() const { return *sum_; }

 private:
  std::shared_ptr<std::atomic<std::uint64_t>> sum_ = std::make_shared<std::atomic<std::uint64_t>>(0);
};

}  // namespace server::http
