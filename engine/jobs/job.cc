#include "engine/jobs/job.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <limits>

#include "engine/core/numbers.h"

namespace engine::jobs {
namespace {

constexpr char id_kind = 'e';  // the letter that ids of jobs begin with: every job is an edit today

constexpr std::array<std::string_view, state_count> state_names = {
    "queued", "running", "stop_requested", "cancel_requested", "succeeded", "failed", "cancelled"};

using Row = std::array<std::optional<JobState>, event_count>;

constexpr std::array<Row, state_count> make_transitions() {
  constexpr std::optional<JobState> no;
  constexpr std::optional wait(JobState::queued), run(JobState::running), stop(JobState::stop_requested),
      cancel(JobState::cancel_requested), good(JobState::succeeded), bad(JobState::failed), gone(JobState::cancelled);
  return {{
      //  claim report finish_interval stop cancel succeed fail release make_way abandon requeue
      Row{run, no, no, stop, gone, no, no, no, no, no, no},                   // queued
      Row{run, run, run, stop, cancel, good, bad, run, wait, run, no},        // running
      Row{stop, stop, stop, stop, cancel, good, bad, stop, stop, stop, no},   // stop_requested
      Row{no, cancel, cancel, no, cancel, gone, gone, gone, gone, gone, no},  // cancel_requested
      Row{},                                                                  // succeeded
      Row{no, no, no, no, no, no, no, no, no, no, wait},                      // failed
      Row{no, no, no, no, gone, no, no, no, no, no, no},                      // cancelled
  }};
}
constexpr auto transitions = make_transitions();

std::string refusal(const Job& job, Event event) {
  const std::string is = job.id + " is " + std::string(to_string(job.state));
  if (event == Event::stop && !is_final(job.state)) {
    if (job.state == JobState::cancel_requested) return is + ": it will be discarded, there is nothing to keep";
    return job.id + " has no finished interval to keep yet: wait for the first one, or cancel";
  }
  if (event == Event::stop || event == Event::cancel) return is + ": it has already ended and stays as it is";
  if (event == Event::requeue) return is + ": only what has failed is taken up again";
  return is + (job.claimed ? ", held by a worker" : ", held by no worker") + ": the change does not apply";
}

/// The state after the event; nothing where the event does not apply.
std::optional<JobState> next_state(const Job& job, Event event) {
  const auto next = transitions[std::size_t(job.state)][std::size_t(event)];
  if (!next) return next;
  switch (event) {
    case Event::claim:
      return job.claimed ? std::nullopt : next;
    case Event::stop:
      return job.finished_intervals > 0 ? next : std::nullopt;
    case Event::cancel:
      // A job that no worker holds is cancelled at once: there is nobody to wait for.
      return job.claimed ? next : JobState::cancelled;
    case Event::requeue:
      return next;
    default:
      return job.claimed ? next : std::nullopt;
  }
}

/// Is this brought about by the worker that holds the job?
bool is_of_worker(Event event) {
  switch (event) {
    case Event::report:
    case Event::finish_interval:
    case Event::succeed:
    case Event::fail:
    case Event::release:
    case Event::make_way:
      return true;
    case Event::claim:
    case Event::stop:
    case Event::cancel:
    case Event::abandon:
    case Event::requeue:
      return false;
  }
  return false;
}

/// The process that held the job has died. Its claim goes; who has died too often at the same place is not tried again.
void abandon(Job& job, int max_deaths) {
  job.claimed = false;
  if (is_final(job.state)) return;
  job.deaths = job.deaths > 0 && job.died_at == job.place ? job.deaths + 1 : 1;
  job.died_at = job.place;
  if (max_deaths == 0 || job.deaths < max_deaths) return;
  job.state = JobState::failed;
  const std::string deaths = job.deaths == 1 ? "" : " " + std::to_string(job.deaths) + " times in a row";
  job.error = Error{ErrorCode::internal,
                    "the service ended" + deaths + " while it was at this job" +
                        (job.place.empty() ? "" : " (" + job.place + ")") +
                        ", which is not taken up again: it may need more memory than there is",
                    job.id};
}

}  // namespace

std::string_view to_string(JobState state) { return state_names[std::size_t(state)]; }

std::optional<JobState> parse_state(std::string_view name) {
  const auto found = std::find(state_names.begin(), state_names.end(), name);
  if (found == state_names.end()) return std::nullopt;
  return JobState(std::distance(state_names.begin(), found));
}

bool is_final(JobState state) {
  return state == JobState::succeeded || state == JobState::failed || state == JobState::cancelled;
}

std::string id_of(std::int64_t number) { return numbered_id(id_kind, std::uint64_t(number)); }

std::optional<std::int64_t> number_of(std::string_view id) {
  const auto number = number_of_id(id_kind, id);
  if (!number || *number > std::uint64_t(std::numeric_limits<std::int64_t>::max())) return std::nullopt;
  return std::int64_t(*number);
}

Time turn_of(const Job& job) {
  if (job.state == JobState::stop_requested || job.expected <= negligible) return job.created;
  return job.created + stretch * (job.expected - negligible);
}

Result<void> check_claim(const Job& job, std::int64_t claim) {
  if (job.claimed && job.claim_number == claim) return {};
  if (job.claim_number != claim)
    return fail(ErrorCode::conflict,
                job.id + " has been taken over (claim " + std::to_string(job.claim_number) + " came after claim " +
                    std::to_string(claim) + "): nothing that was made of it under the old claim counts",
                job.id);
  return fail(ErrorCode::conflict,
              job.id + " is " + std::string(to_string(job.state)) + " and held by no worker: claim " +
                  std::to_string(claim) + " is over",
              job.id);
}

Result<Job> transition(Job job, const Change& change, Time now) {
  if (is_of_worker(change.event) && job.claimed)
    if (auto holds = check_claim(job, change.claim); !holds) return propagate(holds);
  const auto next = next_state(job, change.event);
  if (!next) return fail(ErrorCode::conflict, refusal(job, change.event), job.id);
  const bool was_final = is_final(job.state);
  job.state = *next;
  if (change.progress) job.progress = *change.progress;
  if (is_of_worker(change.event)) job.worked += change.worked;
  switch (change.event) {
    case Event::claim:
      job.claimed = true;
      ++job.claim_number;
      job.holder = change.holder;
      job.claimed_at = now;
      job.place.clear();
      if (!job.started) job.started = now;
      break;
    case Event::finish_interval:
      if (change.interval <= job.finished_intervals)
        return fail(ErrorCode::invalid_argument,
                    "interval " + std::to_string(change.interval) + " follows interval " +
                        std::to_string(job.finished_intervals) + ": intervals must count up",
                    job.id);
      job.finished_intervals = change.interval;
      job.deaths = 0;
      break;
    case Event::succeed:
      if (*next == JobState::succeeded) {
        job.result = change.result;
        job.stopped_early = change.stopped_early;
      }
      break;
    case Event::fail:
      if (*next == JobState::failed) job.error = change.error;
      break;
    case Event::release:
    case Event::make_way:
      job.claimed = false;
      break;
    case Event::abandon:
      abandon(job, change.max_deaths);
      break;
    case Event::report:
      if (change.place) job.place = *change.place;
      break;
    case Event::requeue:
      job.finished_intervals = change.interval;
      if (change.interval == 0) job.progress.clear();  // of work that is done anew, its time included
      job.error.reset();
      job.ended.reset();
      job.deaths = 0;
      job.died_at.clear();
      job.place.clear();
      break;
    case Event::stop:
    case Event::cancel:
      break;
  }
  if (is_final(job.state) && !was_final) {
    job.claimed = false;
    job.ended = now;
  }
  return job;
}

}  // namespace engine::jobs
