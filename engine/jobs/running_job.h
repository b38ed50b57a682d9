// What connects a running job with those who ask about it. Only this room includes this header.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>

#include "engine/jobs/queue.h"

namespace engine::jobs {

/// A claimed job. Safe to use from any thread.
struct Queue::RunningJob {
  explicit RunningJob(const Job& job) : id(job.id), claim(job.claim_number) {}

  const std::string id;
  const std::int64_t claim;
  std::stop_source interrupt;      ///< Fires when the job is cancelled or lost, or the worker has no time left.
  std::atomic<bool> stop = false;  ///< Set when the job is to end and keep its last finished interval.
  std::atomic<bool> lost = false;  ///< Set when another has taken the job over, or has ended it.
  std::atomic<bool> ends = false;  ///< Set once its end is being recorded, which ends the claim, too.

  /// What the record says now, others may have asked for.
  void heed(JobState state) {
    if (state == JobState::cancel_requested) interrupt.request_stop();
    if (state == JobState::stop_requested) stop = true;
  }
  /// An error of the store about this claim: is it over?
  bool is_over(const Error& error) {
    if (error.code != ErrorCode::conflict && error.code != ErrorCode::not_found) return false;
    lost = true;
    interrupt.request_stop();
    return true;
  }

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
