// What the tests of the job queue share.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include "engine/jobs/queue.h"
#include "engine/jobs/sqlite_store.h"
#include "tests/support/data.h"
#include "tests/support/full_disk.h"

namespace engine::jobs {

using support::FullDisk;

/// How long a test waits for what has to come. Only a failure takes so long; on a busy machine a sanitizer needs more.
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
inline constexpr std::chrono::minutes patience{5};
#else
inline constexpr std::chrono::minutes patience{1};
#endif

/// The value, or a test that ends with the error's message.
template <class T>
T value(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().where + ": " + result.error().message);
  if constexpr (!std::is_void_v<T>) return std::move(*result);
}

/// The code of a result that must be an error.
template <class T>
ErrorCode code_of(const Result<T>& result) {
  if (result) throw std::runtime_error("expected an error");
  return result.error().code;
}

inline std::unique_ptr<SqliteStore> open_store(const std::filesystem::path& folder) {
  return value(SqliteStore::open({.folder = folder, .busy_timeout = std::chrono::milliseconds(20)}));
}

inline std::unique_ptr<Queue> open_queue(Store& store, const std::filesystem::path& folder,
                                         std::size_t max_queued = 100) {
  return value(Queue::open(store, {.folder = folder / "jobs", .max_queued = max_queued}));
}

/// The job once `wanted(job)` holds; ends the test when patience does.
template <class Wanted>
Job wait_for(Queue& queue, const std::string& id, Wanted wanted) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  for (auto seen = queue.revision();; seen = queue.wait_for_change(seen, std::chrono::seconds(1))) {
    Job job = value(queue.find(id));
    if (wanted(job)) return job;
    if (std::chrono::steady_clock::now() > deadline)
      throw std::runtime_error(id + " still is " + std::string(to_string(job.state)));
  }
}
inline Job wait_for_end(Queue& queue, const std::string& id) {
  return wait_for(queue, id, [](const Job& job) { return is_final(job.state); });
}
inline Job wait_for_interval(Queue& queue, const std::string& id, int interval) {
  return wait_for(queue, id, [=](const Job& job) { return job.finished_intervals >= interval; });
}

}  // namespace engine::jobs
