#include "engine/jobs/worker.h"

#include <algorithm>
#include <exception>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/core/atomic_file.h"
#include "engine/jobs/durable_file.h"
#include "engine/jobs/notes.h"
#include "engine/jobs/running_job.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;
using std::chrono::steady_clock;

constexpr std::string_view checkpoint_prefix = "checkpoint-";

std::int64_t now_ms() {
  return std::chrono::floor<std::chrono::milliseconds>(steady_clock::now().time_since_epoch()).count();
}

/// Is the cause of this error one that may pass by itself?
bool worth_retrying(const Error& error) {
  return error.code == ErrorCode::no_space || error.code == ErrorCode::unavailable || error.code == ErrorCode::busy;
}

/// Removes the files of a folder whose names begin with the prefix.
void remove_files(const fs::path& folder, std::string_view prefix) {
  std::error_code error;
  std::vector<fs::path> found;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    if (entry->path().filename().string().starts_with(prefix)) found.push_back(entry->path());
  for (const fs::path& file : found) fs::remove(file, error);
}

}  // namespace

JobContext::JobContext(Worker& worker, Job job, Queue::RunningJob& running)
    : worker_(worker),
      queue_(worker.queue_),
      job_(std::move(job)),
      running_(running),
      last_write_(steady_clock::now().time_since_epoch().count()),
      counted_from_ms_(now_ms()) {}

std::chrono::milliseconds JobContext::take_worked() {
  const std::int64_t now = now_ms();
  return std::chrono::milliseconds(std::max<std::int64_t>(now - counted_from_ms_.exchange(now), 0));
}

fs::path JobContext::folder() const { return queue_.folder_of(job_.id); }

fs::path JobContext::checkpoint_file(int interval) const {
  return folder() / (std::string(checkpoint_prefix) + std::to_string(interval));
}

Result<std::string> JobContext::load_checkpoint() const { return read_bytes(checkpoint_file(job_.finished_intervals)); }

Result<void> JobContext::save_checkpoint(int interval, std::string_view bytes,
                                         std::optional<std::chrono::milliseconds> left) {
  const int previous = job_.finished_intervals;
  const Change change{
      .event = Event::finish_interval, .claim = running_.claim, .progress = running_.progress(), .interval = interval};
  // The number is checked before the file is written: a wrong one must not overwrite the checkpoint that the record
  // speaks of.
  if (auto allowed = transition(job_, change, {}); !allowed) return propagate(allowed);
  if (auto held = confirm_claim(); !held) return held;
  if (auto made = create_folder(folder()); !made) return made;
  if (auto written = write_durably(checkpoint_file(interval), bytes); !written) return written;
  if (auto recorded = record_interval(change); !recorded) return recorded;
  job_.finished_intervals = interval;
  std::error_code ignored;
  fs::remove(checkpoint_file(previous), ignored);
  queue_.bump_revision();
  if (running_.interrupt.stop_requested() || worker_.draining_)
    return fail(ErrorCode::cancelled, job_.id + " was interrupted after interval " + std::to_string(interval), job_.id);
  // A store that cannot say so now is met where it matters, at the next checkpoint.
  makes_way_ = left && queue_.store_.should_make_way(job_.id, *left).value_or(false);
  if (makes_way_)
    return fail(ErrorCode::cancelled, job_.id + " makes way after interval " + std::to_string(interval), job_.id);
  return {};
}

tl::unexpected<Error> JobContext::taken_over() const {
  return fail(ErrorCode::cancelled, job_.id + " has been taken over by another worker", job_.id);
}

Result<void> JobContext::wait_for_store(const Error& error) {
  if (error.code != ErrorCode::unavailable) return tl::make_unexpected(error);
  const auto last_revision = queue_.revision();
  worker_.set_trouble(error);
  if (worker_.draining_ || running_.interrupt.stop_requested())
    return fail(ErrorCode::cancelled, job_.id + " was interrupted while the job store could not be reached", job_.id);
  queue_.wait_for_change(last_revision, worker_.options_.retry_period);
  return {};
}

Result<void> JobContext::confirm_claim() {
  for (;;) {
    const auto renewed = queue_.store_.renew(job_.id, running_.claim);
    if (renewed) {
      worker_.store_has_answered();
      running_.heed(*renewed);
      return {};
    }
    if (running_.is_over(renewed.error())) return taken_over();
    if (auto again = wait_for_store(renewed.error()); !again) return again;
  }
}

Result<void> JobContext::write(Change change) {
  change.claim = running_.claim;
  change.worked = take_worked();
  const auto written = queue_.store_.apply(job_.id, change);
  if (!written) counted_from_ms_ -= change.worked.count();  // for the next one that is
  if (written) {
    worker_.store_has_answered();
    running_.heed(written->state);
    return {};
  }
  if (running_.is_over(written.error())) return taken_over();
  return propagate(written);
}

Result<void> JobContext::record_interval(const Change& change) {
  for (;;) {
    const auto written = write(change);
    if (written) return written;
    if (auto again = wait_for_store(written.error()); !again) return again;
    // What had no answer may have been done, and would be refused a second time.
    auto record = queue_.store_.find(job_.id);
    for (; !record; record = queue_.store_.find(job_.id))
      if (auto again = wait_for_store(record.error()); !again) return again;
    if (record->claim_number == running_.claim && record->finished_intervals == change.interval) return {};
  }
}

void JobContext::enter(const std::string& place) {
  if (place == job_.place) return;
  job_.place = place;
  // A disk that is full is met at the next checkpoint; until then a death counts for the place before.
  (void)write({.event = Event::report, .progress = running_.progress(), .place = place});
}

void JobContext::publish_progress(std::string progress) {
  running_.set_progress(progress);
  queue_.bump_revision();
  const auto now = steady_clock::now().time_since_epoch().count();
  auto last = last_write_.load();
  if (steady_clock::duration(now - last) < worker_.options_.progress_period) return;
  if (!last_write_.compare_exchange_strong(last, now)) return;  // another thread is just writing
  // Progress on disk is a comfort after a restart. A full disk shows where it matters, at the next checkpoint.
  (void)write({.event = Event::report, .progress = std::move(progress)});
}

std::stop_token JobContext::cancel_token() const { return running_.interrupt.get_token(); }

bool JobContext::stop_requested() const { return running_.stop; }

Worker::Worker(Queue& queue, JobFunction function, const WorkerOptions& options)
    : queue_(queue), function_(std::move(function)), options_(options) {
  // Both from here: a thread has the priority of the one that starts it, and a job may lower that of its own.
  if (const auto lease = queue_.store_.lease()) keeper_ = std::thread([this, lease] { keep_claims(*lease); });
  thread_ = std::thread([this] {
    loop();
    finished_.set_value();
  });
}

Worker::~Worker() { drain(std::chrono::milliseconds(0)); }

void Worker::drain(std::chrono::milliseconds grace) {
  if (!thread_.joinable()) return;
  draining_ = true;
  queue_.bump_revision();
  if (finished_.get_future().wait_for(grace) != std::future_status::ready) {
    const std::lock_guard lock(mutex_);
    out_of_time_ = true;
    if (current_) current_->interrupt.request_stop();
  }
  thread_.join();
  {
    const std::lock_guard lock(mutex_);
    has_ended_ = true;
  }
  ends_.notify_all();
  if (keeper_.joinable()) keeper_.join();
}

bool Worker::wait_to_renew(std::chrono::milliseconds period) {
  std::unique_lock lock(mutex_);
  return !ends_.wait_for(lock, period, [this] { return has_ended_; });
}

void Worker::keep_claims(std::chrono::milliseconds lease) {
  // Two may go wrong before a claim runs out.
  const auto often = lease / 3;
  for (auto period = often; wait_to_renew(period);) {
    period = often;
    const auto running = [this] {
      const std::lock_guard lock(mutex_);
      return current_;
    }();
    if (!running || running->lost) continue;
    const auto renewed = queue_.store_.renew(running->id, running->claim);
    if (renewed) {
      claim_is_kept();
      running->heed(*renewed);
    } else if (!running->ends && !running->is_over(renewed.error())) {
      claim_cannot_be_kept(renewed.error());
      period = std::min(often, options_.retry_period);
    }
  }
}

std::optional<Error> Worker::trouble() const {
  const std::lock_guard lock(mutex_);
  return trouble_;
}

void Worker::set_trouble(std::optional<Error> error) {
  const std::lock_guard lock(mutex_);
  trouble_ = std::move(error);
  is_trouble_of_claim_ = false;
}

void Worker::claim_cannot_be_kept(Error error) {
  const std::lock_guard lock(mutex_);
  trouble_ = std::move(error);
  is_trouble_of_claim_ = true;
}

void Worker::claim_is_kept() {
  store_has_answered();
  const std::lock_guard lock(mutex_);
  if (is_trouble_of_claim_) trouble_.reset();
}

void Worker::store_has_answered() {
  const std::lock_guard lock(mutex_);
  if (trouble_ && trouble_->code == ErrorCode::unavailable) trouble_.reset();
}

void Worker::set_current(std::shared_ptr<Queue::RunningJob> running) {
  const std::lock_guard lock(mutex_);
  if (running && out_of_time_) running->interrupt.request_stop();
  current_ = std::move(running);
}

void Worker::loop() {
  constexpr std::chrono::milliseconds alone = std::chrono::minutes(1);  // who hears of every change
  // The revision is read before the store is: a change in between then ends the wait at once.
  for (auto last_revision = queue_.revision(); !draining_; last_revision = queue_.revision()) {
    const auto expired = queue_.expire();
    const auto job = queue_.store_.claim();
    if (!expired || !job) {
      set_trouble(expired ? job.error() : expired.error());
    } else {
      set_trouble(std::nullopt);
    }
    if (job && *job) {
      run(**job);
    } else {
      const auto unless_woken = queue_.store_.lease() ? options_.poll_period : alone;
      queue_.wait_for_change(last_revision, job ? unless_woken : options_.retry_period);
    }
  }
}

void Worker::run(const Job& job) {
  const auto running = std::make_shared<Queue::RunningJob>(job);
  queue_.attach(job.id, running);
  set_current(running);
  // A stop or cancel between the claim and attach() has reached the record only.
  const auto record = queue_.store_.find(job.id);
  running->heed(record ? record->state : job.state);
  queue_.bump_revision();
  remove_files(queue_.folder_of(job.id), temporary_prefix);  // left by an attempt that was killed while it wrote

  JobContext context(*this, job, *running);
  const auto outcome = call(context);
  Change change{.event = Event::succeed, .claim = running->claim, .progress = running->progress()};
  change.worked = context.take_worked();
  if (outcome) {
    change.result = outcome->text;
    change.stopped_early = outcome->stopped_early;
  } else if (outcome.error().code == ErrorCode::cancelled && draining_) {
    change.event = Event::release;
  } else if (outcome.error().code == ErrorCode::cancelled && context.makes_way_) {
    change.event = Event::make_way;
  } else {
    change.event = Event::fail;
    change.error = outcome.error();
  }
  record_end(*running, change);
  set_current(nullptr);
  queue_.detach(job.id);
  queue_.bump_revision();
}

Result<JobResult> Worker::call(JobContext& context) const {
  if (context.cancel_token().stop_requested() || draining_)
    return fail(ErrorCode::cancelled, context.id() + " was interrupted before it began", context.id());
  try {
    return function_(context);
  } catch (const std::exception& e) {
    return fail(ErrorCode::internal, std::string("the job met an unexpected error, please report it: ") + e.what(),
                context.id());
  } catch (...) {
    return fail(ErrorCode::internal, "the job met an unexpected error, please report it", context.id());
  }
}

Result<Job> Worker::try_to_record_end(const std::string& id, const Change& change) {
  const std::lock_guard lock(queue_.ends_mutex_);
  auto job = queue_.store_.apply(id, change);
  // It may have been recorded before, and only the answer been lost.
  if (!job && job.error().code == ErrorCode::conflict)
    if (auto known = queue_.store_.find(id); known && is_final(known->state) && known->claim_number == change.claim)
      job = std::move(known);
  if (!job || !is_final(job->state)) return job;
  queue_.note_end(*job);
  if (job->state == JobState::cancelled) {
    std::error_code ignored;
    fs::remove_all(queue_.folder_of(id), ignored);
  } else if (job->state == JobState::succeeded || (job->error && job->error->code == ErrorCode::no_space)) {
    // Of one that failed it stays, which may be taken up again; but not where it helps to keep the disk full.
    remove_files(queue_.folder_of(id), checkpoint_prefix);
  }
  // Another process may have removed the record, or had the job taken up again, before this one had put the note and
  // the files away.
  const auto record = queue_.store_.find(id);
  if (record ? !is_final(record->state) : record.error().code == ErrorCode::not_found) queue_.note_what_is_recorded(id);
  return job;
}

void Worker::record_end(Queue::RunningJob& running, const Change& change) {
  running.ends = true;
  // Of a job that another has, neither the record nor the files are this worker's business.
  while (!running.lost) {
    const auto last_revision = queue_.revision();
    const auto recorded = try_to_record_end(running.id, change);
    if (recorded && is_final(recorded->state) && options_.ended) options_.ended(*recorded);
    if (recorded || running.is_over(recorded.error())) return;
    set_trouble(recorded.error());
    // A failed job's own files may be what took the last bytes.
    if (std::error_code ignored; change.event == Event::fail && recorded.error().code == ErrorCode::no_space &&
                                 fs::remove_all(queue_.folder_of(running.id), ignored) > 0 && !ignored)
      continue;
    // Whoever finds the job claimed by nobody takes it up at its last checkpoint.
    if (draining_ || !worth_retrying(recorded.error())) return;
    queue_.wait_for_change(last_revision, options_.retry_period);
  }
}

}  // namespace engine::jobs
