// Where job records are kept.
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/jobs/job.h"

namespace engine::jobs {

struct NewJob {
  std::string lane;
  std::string payload;
  std::string idempotency_key = {};  ///< "": none.
};

struct Submission {
  Job job;
  bool created = true;  ///< false: it had been submitted before, under the same idempotency key.
};

struct Filter {
  std::optional<std::string> lane = {};  ///< Only this one.
  bool active_only = false;              ///< Leave out what has ended.
  std::size_t limit = 100;               ///< The youngest so many.
};

/// Records of ended jobs that are kept. Their idempotency keys are forgotten with them.
struct Retention {
  std::chrono::hours max_age{24 * 30};  ///< Since they ended.
  std::size_t max_count = 1000;         ///< The youngest so many, by their end.
};

/// Keeps job records. Every function is safe to call from any thread, is one transaction (all of it or nothing), and is
/// on disk when it returns: a power cut or kill -9 afterwards undoes nothing.
///   errors of all  no_space: the disk is full; nothing was changed, and the store works again once there is space
///                  unavailable: the storage is held by somebody else or cannot be reached
///                  corrupt_data: the storage is damaged; `where` names it
///                  not_found: no job has this id
class Store {
 public:
  virtual ~Store() = default;

  /// Accepts a job.
  ///   max_queued  so many may wait
  ///   errors      busy: as many wait already; unprocessable: the idempotency key belongs to another payload or lane
  [[nodiscard]] virtual Result<Submission> submit(const NewJob& job, std::size_t max_queued) = 0;
  [[nodiscard]] virtual Result<Job> find(const std::string& id) = 0;
  /// The job that was submitted under this idempotency key; nothing if none was.
  [[nodiscard]] virtual Result<std::optional<Job>> find_key(const std::string& idempotency_key) = 0;
  /// Youngest first, payloads and results left out.
  [[nodiscard]] virtual Result<std::vector<Job>> list(const Filter& filter) = 0;
  /// Gives the oldest job that can run to the caller; nothing if none can. A job can run if nobody holds it and no
  /// older one of its lane has yet to end.
  [[nodiscard]] virtual Result<std::optional<Job>> claim() = 0;
  /// Changes a record by the rules of after().
  ///   returns  the record afterwards
  ///   errors   those of after()
  [[nodiscard]] virtual Result<Job> apply(const std::string& id, const Change& change) = 0;
  /// Removes the record of an ended job.
  ///   errors  conflict: it has not ended
  [[nodiscard]] virtual Result<void> remove(const std::string& id) = 0;
  /// Removes what need not be kept.
  ///   returns  the ids removed
  [[nodiscard]] virtual Result<std::vector<std::string>> expire(const Retention& retention) = 0;
};

}  // namespace engine::jobs
