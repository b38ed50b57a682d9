// What connects a running job with those who ask about it. Only this room includes this header.
#pragma once

#include <atomic>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>

#include "engine/jobs/queue.h"

namespace engine::jobs {

/// A claimed job. Safe to use from any thread.
struct Queue::RunningJob {
  std::stop_source interrupt;      ///< Fires when the job is cancelled, or the worker has no time left.
  std::atomic<bool> stop = false;  ///< Set when the job is to end and keep its last finished interval.

  void set_progress(std::string text) {
    const std::lock_guard lock(mutex_);
    progress_ = std::move(text);
  }
  /// The progress that this worker published last. Nothing before it has published any: the record then has the latest.
  [[nodiscard]] std::optional<std::string> progress() const {
    const std::lock_guard lock(mutex_);
    return progress_;
  }

 private:
  mutable std::mutex mutex_;
  std::optional<std::string> progress_;
};

}  // namespace engine::jobs
