// How much memory a piece of work takes.
#pragma once

#include <cstdint>

namespace engine::evaluate {

/// Watches how far the resident memory of this process rises above where it stood when this was made. Linux tells;
/// where the system does not, all is 0. One at a time: the system keeps one peak for the whole process.
class MemoryPeak {
 public:
  MemoryPeak();

  /// Takes in how high memory has risen since the start, or since forget().
  void note();
  /// What rose since the last note() does not count: it was not the work's.
  void forget();
  /// Most that was noted, bytes above the start.
  [[nodiscard]] std::uint64_t bytes() const { return highest_ > start_ ? highest_ - start_ : 0; }

 private:
  std::uint64_t start_ = 0, highest_ = 0;
};

}  // namespace engine::evaluate
