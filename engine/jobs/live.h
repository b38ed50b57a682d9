// What connects a running job with those who ask about it. Of this room only.
#pragma once

#include <atomic>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>

#include "engine/jobs/queue.h"

namespace engine::jobs {

struct Queue::Live {
  std::stop_source interrupt;      ///< Cancelled, or the worker has no time left.
  std::atomic<bool> stop = false;  ///< Keep the last finished interval.

  void set_progress(std::string text) {
    const std::lock_guard lock(mutex_);
    progress_ = std::move(text);
  }
  /// Nothing until this worker has published some: what the record says is then the latest.
  [[nodiscard]] std::optional<std::string> progress() const {
    const std::lock_guard lock(mutex_);
    return progress_;
  }

 private:
  mutable std::mutex mutex_;
  std::optional<std::string> progress_;
};

}  // namespace engine::jobs
