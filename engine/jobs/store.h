// The store of job records, as the queue and its workers see it.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/jobs/job.h"

namespace engine::jobs {

/// How much somebody may ask for. What is not said has no limit.
struct Quota {
  std::optional<std::size_t> active = {};                        ///< Jobs that have not ended.
  std::optional<std::chrono::milliseconds> worked_per_day = {};  ///< Of work, from midnight to midnight UTC.
};
/// How much of that is used.
struct Usage {
  std::size_t active = 0;
  std::chrono::milliseconds expected{0};      ///< What is left of these jobs, as they were handed in.
  std::chrono::milliseconds worked_today{0};  ///< On all jobs of theirs, removed ones included.
};

/// A job as it is handed in.
struct NewJob {
  std::string lane;
  std::string payload;
  std::string idempotency_key = {};       ///< "": none.
  std::chrono::milliseconds expected{0};  ///< As of Job.
  std::string requester = {};             ///< As of Job.
  Quota quota = {};                       ///< Of the requester.
};

/// The answer to a job that was handed in.
struct Submission {
  Job job;
  bool created = true;  ///< false: it had been submitted before, under the same idempotency key.
};

/// Sees the record of a job that is about to be accepted; an error keeps it from being accepted.
using Witness = std::function<Result<void>(const Job&)>;

/// Which jobs a list holds.
struct Filter {
  std::optional<std::string> lane = {};  ///< Lists only jobs of this lane.
  bool active_only = false;              ///< Leaves out jobs that have ended.
  std::size_t limit = 100;               ///< Most jobs in the list; the youngest are listed.
};

/// How long records of ended jobs are kept. A record's idempotency key is forgotten with it. Both limits are choices.
struct Retention {
  std::chrono::hours max_age{24 * 30};  ///< Longest time since the job ended: 30 days.
  std::size_t max_count = 1000;         ///< Most records of ended jobs; those that ended last are kept.
};

/// Keeps job records. Every function is safe to call from any thread, is one transaction (all of it or nothing), and is
/// on disk when it returns: a power cut or kill -9 afterwards undoes nothing.
///   errors of all  no_space: the disk is full; nothing was changed, and the store works again once there is space
///                  unavailable: the storage is held by somebody else or cannot be reached. Where it lies elsewhere and
///                  the answer was lost on the way, what was asked for may have been done all the same
///                  corrupt_data: the storage is damaged; `where` names it
///                  not_found: no job has this id
class Store {
 public:
  virtual ~Store() = default;

  /// Accepts a job.
  ///   max_queued  most jobs that may wait
  ///   witness     called for a new job before anybody else can see it. When submit() returns an error afterwards, the
  ///               job does not exist
  ///   errors      busy: as many wait already; unprocessable: the idempotency key belongs to another payload or lane;
  ///               quota_exceeded: the requester's (`where` is "active" or "worked_per_day"); too_large: it takes more
  ///               than a whole "worked_per_day"; those of `witness`
  [[nodiscard]] virtual Result<Submission> submit(const NewJob& job, std::size_t max_queued,
                                                  const Witness& witness) = 0;
  [[nodiscard]] Result<Submission> submit(const NewJob& job, std::size_t max_queued) {
    return submit(job, max_queued, [](const Job&) -> Result<void> { return {}; });
  }
  /// Whether one more may wait, as submit() would say.
  ///   errors  busy: as many wait already
  [[nodiscard]] virtual Result<void> check_room(std::size_t max_queued) = 0;
  /// Whether the requester's quota has room for the job, as submit() would say.
  ///   errors  quota_exceeded; too_large
  [[nodiscard]] virtual Result<void> check_quota(const NewJob& job) = 0;
  /// What a requester has used of any quota.
  [[nodiscard]] virtual Result<Usage> usage(const std::string& requester) = 0;
  /// Has a job that has failed taken up again (Event::requeue).
  ///   finished_intervals  that of the checkpoint that is still there; 0: there is none
  ///   witness             called with the record as it will be, before anybody else can see or change it. When
  ///                       requeue() returns an error afterwards, nothing has changed
  ///   returns             the record afterwards
  ///   errors              conflict: it has not failed, or a younger job of its lane has yet to end; those of `witness`
  [[nodiscard]] virtual Result<Job> requeue(const std::string& id, int finished_intervals, const Witness& witness) = 0;
  [[nodiscard]] Result<Job> requeue(const std::string& id, int finished_intervals) {
    return requeue(id, finished_intervals, [](const Job&) -> Result<void> { return {}; });
  }
  /// The time by which records are dated: that of the storage, wherever that is.
  [[nodiscard]] virtual Result<Time> now() = 0;
  /// Puts back a record that was lost, or that is known to have become this one. Nobody holds the job afterwards.
  ///   errors  conflict: another job has its idempotency key
  [[nodiscard]] virtual Result<void> restore(const Job& job) = 0;
  [[nodiscard]] virtual Result<Job> find(const std::string& id) = 0;
  /// The job that was submitted under this idempotency key; nothing if none was.
  [[nodiscard]] virtual Result<std::optional<Job>> find_key(const std::string& idempotency_key) = 0;
  /// The jobs that pass the filter, youngest first, without payloads and results.
  [[nodiscard]] virtual Result<std::vector<Job>> list(const Filter& filter) = 0;
  /// Gives the job that can run and comes first to the caller; nothing if none can. A job can run if nobody holds it
  /// and no older one of its lane has yet to end. One that was running when its worker went away comes first: it has
  /// not made way. Then comes the one whose turn (turn_of()) is earliest. Its `claim_number` is the caller's: with it
  /// go renew() and what apply() is to change; its `holder` is who the store was opened by.
  [[nodiscard]] virtual Result<std::optional<Job>> claim() = 0;
  /// How long a claim lasts that is not renewed; then others may take the job over. Nothing: as long as the process.
  [[nodiscard]] virtual std::optional<std::chrono::milliseconds> lease() const = 0;
  /// Has a claim last for a whole lease from now on. Waits for none of the other functions.
  ///   returns  the job's state, which others may have changed
  ///   errors   those of check_claim()
  [[nodiscard]] virtual Result<JobState> renew(const std::string& id, std::int64_t claim) = 0;
  /// Whether this job, which runs, should make way: the one that claim() would give out now has an earlier turn, and is
  /// only to end or takes at most half of `left`. One that is not much shorter would only delay this one.
  ///   left  what the rest of the job should take
  [[nodiscard]] virtual Result<bool> should_make_way(const std::string& id, std::chrono::milliseconds left) = 0;
  /// Changes a record by the rules of transition().
  ///   returns  the record afterwards
  ///   errors   those of transition()
  [[nodiscard]] virtual Result<Job> apply(const std::string& id, const Change& change) = 0;
  /// Removes the record of an ended job.
  ///   errors  conflict: it has not ended
  [[nodiscard]] virtual Result<void> remove(const std::string& id) = 0;
  /// Removes the records that `retention` does not keep.
  ///   returns  the ids removed
  [[nodiscard]] virtual Result<std::vector<std::string>> expire(const Retention& retention) = 0;
  /// From now on `news` is called, by a thread of the store, when others may have changed something: a hint, which may
  /// come late, too often, or not at all. An empty function ends that: it is not called any more when this returns.
  virtual void watch(std::function<void()> news) = 0;
};

}  // namespace engine::jobs
