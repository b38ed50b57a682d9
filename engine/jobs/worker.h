// A thread that carries out the jobs of a queue, in the order of their turns (turn_of()).
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>

#include "engine/jobs/queue.h"

namespace engine::jobs {

class JobContext;
class Worker;

/// The result of a job function.
struct JobResult {
  std::string text;            ///< Opaque; becomes Job::result.
  bool stopped_early = false;  ///< Fewer intervals than asked for, because stop_requested().
};

/// The work. Called once per job, and again with the same payload after an interruption: it then starts from the last
/// checkpoint, so that what it returns does not depend on where it was interrupted. What it does outside its own folder
/// must bear being done twice. An error that the context gives it is to be returned.
///   errors  any; the job ends as failed with it. After a cancel, whatever it returns is dropped.
/// An exception that leaves it is a bug: the job ends as failed with ErrorCode::internal.
using JobFunction = std::function<Result<JobResult>(JobContext&)>;

/// Periods of a worker; all are choices.
struct WorkerOptions {
  std::chrono::milliseconds progress_period{1000};  ///< Shortest time between two writes of progress to disk.
  std::chrono::milliseconds retry_period{1000};     ///< Time to wait after an error of the store.
  /// So often an idle worker looks at a store that others use, too, whether or not it has heard from them.
  std::chrono::milliseconds poll_period{2000};
  /// Is told of each job whose end this worker has recorded, right after that: what a job has made may now be shown, or
  /// is to be dropped. Not told where the process dies in between. Empty: nobody is.
  std::function<void(const Job&)> ended = {};
};

/// A running job as its function sees it. All of it may be called from any thread, except save_checkpoint(): by one
/// thread at a time.
class JobContext {
 public:
  [[nodiscard]] const std::string& id() const { return job_.id; }
  [[nodiscard]] const std::string& payload() const { return job_.payload; }
  /// Number of the claim under which this attempt is made; no other attempt has it.
  [[nodiscard]] std::int64_t claim() const { return job_.claim_number; }
  /// The progress that was published last before this attempt; empty at the first one.
  [[nodiscard]] const std::string& earlier_progress() const { return job_.progress; }
  /// The folder for files of the job; they live as long as its record, or until it is cancelled. Absent before the
  /// first checkpoint. Names that begin with "checkpoint-" are taken.
  [[nodiscard]] std::filesystem::path folder() const;

  /// Number of intervals that need not be done again; 0 at the first attempt.
  [[nodiscard]] int finished_intervals() const { return job_.finished_intervals; }
  /// The bytes of the checkpoint of interval finished_intervals().
  ///   errors  not_found: there is none, or its file has been taken away; unavailable
  [[nodiscard]] Result<std::string> load_checkpoint() const;
  /// Puts the state after an interval on disk, then says so in the record: kill -9 at any moment leaves either this
  /// checkpoint or the one before, whole.
  ///   interval  larger than finished_intervals()
  ///   left      what the rest should take, if that is known: a shorter job then goes first from here on
  ///   errors    cancelled: it was saved, but the job is to end here, for good or for a while (cancel, shutdown, a
  ///             shorter job: return the error), or it was not saved, as of confirm_claim(); invalid_argument:
  ///             `interval` does not count up; no_space, unavailable: it was not saved
  [[nodiscard]] Result<void> save_checkpoint(int interval, std::string_view bytes,
                                             std::optional<std::chrono::milliseconds> left = std::nullopt);
  /// Asks the store whether the job still is this worker's. To be called before something of it becomes visible outside
  /// of its folder: a process that was halted for longer than its claim lasts goes on in the middle of its work, while
  /// another does the same. A store that cannot be reached is waited for.
  ///   errors  cancelled: another has taken the job over, or the worker ends before the store could be asked; those of
  ///           Store
  [[nodiscard]] Result<void> confirm_claim();
  /// Notes on disk what the job does next, so that a process that dies at it time and again is known to: call it where
  /// another kind of work begins, with a text that is the same in each attempt. Costs a write where the text is another
  /// than before. For the thread of save_checkpoint().
  void enter(const std::string& place);
  /// Tells readers how far the job is; they see it at once.
  void publish_progress(std::string progress);

  /// The function polls this token at every step. When it fires, the function returns ErrorCode::cancelled; the work
  /// since the last checkpoint is lost.
  [[nodiscard]] std::stop_token cancel_token() const;
  /// The function calls this at the start and after every interval. True: it is to end now and return the result of the
  /// last finished interval. There is one; it may be that of load_checkpoint(), where the job was interrupted after the
  /// request.
  [[nodiscard]] bool stop_requested() const;

 private:
  friend class Worker;
  JobContext(Worker& worker, Job job, Queue::RunningJob& running);
  [[nodiscard]] std::filesystem::path checkpoint_file(int interval) const;
  /// Brings a change about, in the name of this claim, and heeds what others have asked for.
  ///   errors  cancelled: the claim is over; those of Store
  Result<void> write(Change change);
  /// The same for the end of an interval, whose checkpoint is there; waits for a store that cannot be reached.
  Result<void> record_interval(const Change& change);
  /// After an error of the store: waits before it is asked again.
  ///   errors  cancelled: there is no time to wait; `error` itself, if it is not that the store cannot be reached
  Result<void> wait_for_store(const Error& error);
  [[nodiscard]] tl::unexpected<Error> taken_over() const;
  /// The work since this was called last, for a record that is to say so.
  [[nodiscard]] std::chrono::milliseconds take_worked();

  Worker& worker_;
  Queue& queue_;
  Job job_;
  Queue::RunningJob& running_;
  std::atomic<std::chrono::steady_clock::rep> last_write_;  ///< When progress last went to disk.
  std::atomic<std::int64_t> counted_from_ms_;  ///< Work since then is in no record yet; by the steady clock.
  bool makes_way_ = false;
};

/// Runs until drained. Several workers may share a queue, and several queues in as many processes a store. Where claims
/// of the store run out, a second thread renews that of the job in work: it computes nothing, and has the priority of
/// whoever makes the worker, not that of jobs.
class Worker {
 public:
  /// queue  outlives the worker
  Worker(Queue& queue, JobFunction function, const WorkerOptions& options = {});
  ~Worker();  ///< drain() without grace.

  /// Ends the worker. It claims no more jobs; a running one ends at its next checkpoint, or when `grace` is over from
  /// its cancel_token(). It keeps its state and its last checkpoint, and goes on when a worker claims it again.
  /// Returns when the function has.
  void drain(std::chrono::milliseconds grace);
  /// The error of the store that keeps the worker from working. Nothing if all is well.
  [[nodiscard]] std::optional<Error> trouble() const;

 private:
  friend class JobContext;
  void loop();
  void run(const Job& job);
  [[nodiscard]] Result<JobResult> call(JobContext& context) const;
  void record_end(Queue::RunningJob& running, const Change& change);
  /// Once: the record, then the note and the files beside it.
  [[nodiscard]] Result<Job> try_to_record_end(const std::string& id, const Change& change);
  void keep_claims(std::chrono::milliseconds lease);
  /// Whether there is still something to renew when the period is over.
  [[nodiscard]] bool wait_to_renew(std::chrono::milliseconds period);
  void set_trouble(std::optional<Error> error);
  void store_has_answered();  ///< Ends the trouble of one that could not be reached.
  void claim_cannot_be_kept(Error error);
  void claim_is_kept();  ///< Ends the trouble of one that could not be.
  void set_current(std::shared_ptr<Queue::RunningJob> running);

  Queue& queue_;
  const JobFunction function_;
  const WorkerOptions options_;
  std::atomic<bool> draining_ = false;
  mutable std::mutex mutex_;  ///< Guards the five below.
  std::optional<Error> trouble_;
  bool is_trouble_of_claim_ = false;  ///< It came from keep_claims().
  std::shared_ptr<Queue::RunningJob> current_;
  bool out_of_time_ = false;
  bool has_ended_ = false;  ///< Its last claim is over.
  std::condition_variable ends_;
  std::promise<void> finished_;
  std::thread keeper_;  ///< Runs where claims have to be renewed.
  std::thread thread_;
};

}  // namespace engine::jobs
