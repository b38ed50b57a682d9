// The queue as the rest of a program sees it: submit, look, stop, cancel, remove, wait for news.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "engine/jobs/store.h"

namespace engine::jobs {

/// Where the queue keeps files, and how many jobs it holds.
struct QueueOptions {
  std::filesystem::path folder;  ///< Holds one folder per job that needs one, named by its id. Nothing else uses it.
  std::size_t max_queued = 32;   ///< Jobs that may wait. A choice.
  /// Other processes work with the same jobs already: notes and records change at any moment, and are not held against
  /// each other.
  bool others_are_at_work = false;
  Retention retention = {};
};

/// The jobs of a Store, together with the latest progress that their workers know of. Safe to call from any thread.
/// Errors are those of Store, unless said otherwise.
class Queue {
 public:
  /// Makes the folder and holds the store against the notes in it (notes.h), unless others are at work: what the store
  /// has lost is put back, what the notes lack is noted. The folder of a cancelled job goes; one that neither knows
  /// stays.
  ///   store   outlives the queue
  ///   errors  no_space, unavailable; those of Store
  [[nodiscard]] static Result<std::unique_ptr<Queue>> open(Store& store, const QueueOptions& options);
  ~Queue();

  /// What was found amiss when the queue was opened, and what was done about it. `where` is the job's id.
  [[nodiscard]] const std::vector<Error>& findings() const { return findings_; }

  /// Accepts a job: when this returns, it is on disk and will be done. With an idempotency key that is known already it
  /// answers with the job that was accepted then.
  ///   errors  busy: the queue is full; unprocessable: the key belongs to another payload or lane; quota_exceeded,
  ///           too_large
  [[nodiscard]] Result<Submission> submit(const NewJob& job);
  /// Whether there is room for another job, for whoever has work to do before submit(). Others may come first.
  ///   errors  busy: the queue is full
  [[nodiscard]] Result<void> check_room() { return store_.check_room(options_.max_queued); }
  /// Whether submit() would answer with an earlier job: the one under this key, if there is one.
  [[nodiscard]] Result<std::optional<Job>> find_key(const std::string& idempotency_key);
  /// The record, with the latest progress.
  [[nodiscard]] Result<Job> find(const std::string& id);
  [[nodiscard]] Result<std::vector<Job>> list(const Filter& filter = {});
  /// Asks a job to end after its current interval and keep what it has.
  ///   errors  conflict: no interval is finished yet, or the job has ended or is being cancelled
  [[nodiscard]] Result<Job> stop(const std::string& id);
  /// Asks a job to end at once and keep nothing; one that waits is cancelled when this returns. Idempotent.
  ///   errors  conflict: the job has succeeded or failed
  [[nodiscard]] Result<Job> cancel(const std::string& id);
  /// Whether the requester's quota has room for the job. Others may come first.
  ///   errors  quota_exceeded, too_large
  [[nodiscard]] Result<void> check_quota(const NewJob& job) { return store_.check_quota(job); }
  /// Has a job that has failed taken up again, from its last checkpoint if that is still there.
  ///   errors  conflict: it has not failed, or a younger job of its lane has yet to end
  [[nodiscard]] Result<Job> requeue(const std::string& id);
  /// Removes the record and the files of an ended job.
  ///   errors  conflict: it has not ended
  [[nodiscard]] Result<void> remove(const std::string& id);
  /// Removes records and files that need not be kept. Workers do so between jobs.
  [[nodiscard]] Result<void> expire();

  /// The number of changes so far of any record or any progress.
  [[nodiscard]] std::uint64_t revision() const;
  /// Waits until revision() is not `last_revision`, but not longer than `timeout`.
  ///   returns  revision()
  std::uint64_t wait_for_change(std::uint64_t last_revision, std::chrono::milliseconds timeout) const;

 private:
  friend class Worker;
  friend class JobContext;
  struct RunningJob;  ///< A claimed job, as its worker and those who ask about it share it.

  Queue(Store& store, QueueOptions options) : store_(store), options_(std::move(options)) {}
  [[nodiscard]] std::filesystem::path folder_of(const std::string& id) const { return options_.folder / id; }
  /// Writes down how a job has ended. Where that fails, the next open() does.
  void note_end(const Job& job) const;
  /// Writes the note of a job that other processes may just change, or removes its traces where they have removed it.
  void note_what_is_recorded(const std::string& id) const;
  void bump_revision();
  [[nodiscard]] std::shared_ptr<RunningJob> find_running(const std::string& id) const;
  void attach(const std::string& id, std::shared_ptr<RunningJob> running);
  void detach(const std::string& id);
  [[nodiscard]] Job with_latest_progress(Job job) const;

  Store& store_;
  const QueueOptions options_;
  std::vector<Error> findings_;  ///< Only open() writes it.
  /// Held from the record of a job's end, or of its removal, until its note and its files are as the record says. A
  /// record can be read before its worker has put away what is beside it: who removes the job then would find a folder
  /// under change, and its note written anew.
  std::mutex ends_mutex_;
  mutable std::mutex mutex_;  ///< Guards the two below.
  std::map<std::string, std::shared_ptr<RunningJob>> running_;
  std::uint64_t revision_ = 0;
  mutable std::condition_variable changed_;
};

}  // namespace engine::jobs
