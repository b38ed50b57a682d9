#include "engine/jobs/queue.h"

#include <system_error>
#include <utility>

#include "engine/jobs/durable_file.h"
#include "engine/jobs/notes.h"
#include "engine/jobs/reconcile.h"
#include "engine/jobs/running_job.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;

/// Files are removed after their record says that nobody needs them. What cannot be removed now is when the queue is
/// opened next.
void remove_files(const fs::path& folder) {
  std::error_code ignored;
  fs::remove_all(folder, ignored);
}

}  // namespace

Queue::~Queue() { store_.watch({}); }

Result<std::unique_ptr<Queue>> Queue::open(Store& store, const QueueOptions& options) {
  if (auto made = create_folder(options.folder); !made) return propagate(made);
  std::unique_ptr<Queue> queue(new Queue(store, options));
  if (!options.others_are_at_work) {
    auto findings = reconcile(store, options.folder);
    if (!findings) return propagate(findings);
    queue->findings_ = std::move(*findings);
  }
  store.watch([changed = queue.get()] { changed->bump_revision(); });
  return queue;
}

Result<Submission> Queue::submit(const NewJob& job) {
  std::string noted;
  auto submission = store_.submit(job, options_.max_queued, [&](const Job& accepted) {
    noted = accepted.id;
    return write_note(options_.folder, accepted);
  });
  if (!submission) {
    if (!noted.empty()) remove_traces(options_.folder, noted);
    return submission;
  }
  if (submission->created) bump_revision();
  submission->job = with_latest_progress(std::move(submission->job));
  return submission;
}

Result<std::optional<Job>> Queue::find_key(const std::string& idempotency_key) {
  auto job = store_.find_key(idempotency_key);
  if (job && *job) *job = with_latest_progress(std::move(**job));
  return job;
}

Result<Job> Queue::find(const std::string& id) {
  auto job = store_.find(id);
  if (job) *job = with_latest_progress(std::move(*job));
  return job;
}

Result<std::vector<Job>> Queue::list(const Filter& filter) {
  auto jobs = store_.list(filter);
  if (jobs)
    for (Job& job : *jobs) job = with_latest_progress(std::move(job));
  return jobs;
}

Result<Job> Queue::stop(const std::string& id) {
  auto job = store_.apply(id, {.event = Event::stop});
  if (!job) return job;
  if (const auto running = find_running(id)) running->stop = true;
  bump_revision();
  return with_latest_progress(std::move(*job));
}

Result<Job> Queue::cancel(const std::string& id) {
  const std::lock_guard lock(ends_mutex_);
  auto job = store_.apply(id, {.event = Event::cancel});
  if (!job) return job;
  if (const auto running = find_running(id)) running->interrupt.request_stop();
  if (job->state == JobState::cancelled) {
    remove_files(folder_of(id));
    note_end(*job);
  }
  bump_revision();
  return with_latest_progress(std::move(*job));
}

Result<Job> Queue::requeue(const std::string& id) {
  const std::lock_guard lock(ends_mutex_);
  bool noted = false;
  // The note before the commit: one that still says "failed" would count as what the record has lost when the queue is
  // opened. And while the record is held: others change it, too.
  auto requeued = store_.requeue(id, last_checkpoint(folder_of(id)), [&](const Job& again) {
    noted = true;
    return write_note(options_.folder, again);
  });
  if (noted) note_what_is_recorded(id);
  if (!requeued) return requeued;
  bump_revision();
  return with_latest_progress(std::move(*requeued));
}

Result<void> Queue::remove(const std::string& id) {
  const std::lock_guard lock(ends_mutex_);
  const auto job = store_.find(id);
  if (!job) return propagate(job);
  const bool has_ended = is_final(job->state);
  if (has_ended)
    if (auto marked = mark_removed(options_.folder, id); !marked) return marked;
  if (auto removed = store_.remove(id); !removed) {
    if (has_ended) unmark_removed(options_.folder, id);
    return removed;
  }
  remove_traces(options_.folder, id);
  bump_revision();
  return {};
}

Result<void> Queue::expire() {
  const std::lock_guard lock(ends_mutex_);
  const auto expired = store_.expire(options_.retention);
  if (!expired) return propagate(expired);
  for (const std::string& id : *expired) remove_traces(options_.folder, id);
  if (!expired->empty()) bump_revision();
  return {};
}

void Queue::note_end(const Job& job) const { (void)write_note(options_.folder, job); }

void Queue::note_what_is_recorded(const std::string& id) const {
  constexpr int tries = 10;  // a choice: each time the job would have ended, or been requeued, just then
  auto record = store_.find(id);
  for (int i = 0; record && i < tries; ++i) {
    note_end(*record);
    const auto before = std::exchange(record, store_.find(id));
    if (record && record->state == before->state && record->claim_number == before->claim_number) return;
  }
  if (!record && record.error().code == ErrorCode::not_found) remove_traces(options_.folder, id);
}

std::uint64_t Queue::revision() const {
  const std::lock_guard lock(mutex_);
  return revision_;
}

std::uint64_t Queue::wait_for_change(std::uint64_t last_revision, std::chrono::milliseconds timeout) const {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [&] { return revision_ != last_revision; });
  return revision_;
}

void Queue::bump_revision() {
  {
    const std::lock_guard lock(mutex_);
    ++revision_;
  }
  changed_.notify_all();
}

std::shared_ptr<Queue::RunningJob> Queue::find_running(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto found = running_.find(id);
  return found == running_.end() ? nullptr : found->second;
}

void Queue::attach(const std::string& id, std::shared_ptr<RunningJob> running) {
  const std::lock_guard lock(mutex_);
  running_[id] = std::move(running);
}

void Queue::detach(const std::string& id) {
  const std::lock_guard lock(mutex_);
  running_.erase(id);
}

Job Queue::with_latest_progress(Job job) const {
  if (const auto running = find_running(job.id))
    if (auto progress = running->progress()) job.progress = std::move(*progress);
  return job;
}

}  // namespace engine::jobs
