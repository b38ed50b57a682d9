// What the tests of the job queue share.
#pragma once

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include "engine/jobs/queue.h"
#include "engine/jobs/sqlite_store.h"
#include "tests/support/data.h"

namespace engine::jobs {

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

/// The job once `wanted(job)` holds; ends the test after 20 s.
template <class Wanted>
Job wait_for(Queue& queue, const std::string& id, Wanted wanted) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  for (auto seen = queue.version();; seen = queue.wait_for_change(seen, std::chrono::seconds(1))) {
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

/// As long as it lives, no file of this process can grow beyond `bytes`: to whoever writes, a full disk.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{.rlim_cur = bytes, .rlim_max = before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FullDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit before_{};
  void (*handler_)(int);
};

}  // namespace engine::jobs
