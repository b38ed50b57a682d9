// A job's record, its states, and the one place that says how they change.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace engine::jobs {

using Time = std::chrono::sys_time<std::chrono::milliseconds>;

/// Where a job stands. `succeeded`, `failed` and `cancelled` are final.
///
///     queued ----------> running ------> succeeded | failed
///       |                 |    \                ^
///       | cancel   cancel |     \ stop          |
///       v                 |      stop_requested-+
///     cancelled <- cancel_requested <-/ cancel
///
/// - A running job that *makes way* for a shorter one at a checkpoint is queued again, and goes on from there.
/// - *stop* keeps the last finished interval: the job ends `succeeded`, with `stopped_early`. There has to be one.
/// - *cancel* discards. It may be asked for again and again, and it wins: whatever the job still returns is dropped.
/// - A job whose worker went away (shutdown, kill -9) keeps its state. One that ran is claimed again before any that
///   waits; one that was to be cancelled is then `cancelled`.
/// - A job at whose work the process has died several times in a row, at the same place and with nothing finished in
///   between, has `failed`: it may well be what ends the process, and would go on doing so.
/// - An operator may have a job that has failed taken up once more: it is `queued` again, and goes on from its last
///   checkpoint, if that is still there.
enum class JobState { queued, running, stop_requested, cancel_requested, succeeded, failed, cancelled };
inline constexpr int state_count = 7;

[[nodiscard]] std::string_view to_string(JobState state);  ///< "queued", "stop_requested", ...
[[nodiscard]] std::optional<JobState> parse_state(std::string_view name);
[[nodiscard]] bool is_final(JobState state);

/// The record of a job. This room does not read its texts, which may be any bytes.
struct Job {
  std::string id;                         ///< "e000001": counts up, never used twice.
  std::string lane;                       ///< Jobs of one lane run one after the other, in the order of their ids.
  std::string payload;                    ///< The request to carry out. Empty in a list.
  std::string idempotency_key;            ///< "": none.
  std::string requester;                  ///< Who asked for it, as whoever handed it in calls them. "": nobody says.
  std::chrono::milliseconds expected{0};  ///< What the whole work should take, as it was handed in; 0: nobody knows.
  std::chrono::milliseconds worked{0};    ///< What it has taken so far, as far as its workers have said.
  JobState state = JobState::queued;
  bool claimed = false;             ///< A worker holds it.
  std::int64_t claim_number = 0;    ///< Of its last claim; counts up with each. Tells a worker from those before it.
  std::string holder;               ///< Who made that claim, as its process calls itself; stays when the claim is over.
  std::optional<Time> claimed_at;   ///< When that was.
  std::optional<Time> lease_until;  ///< Until then the claim lasts unless it is renewed. None where claims do not end.
  bool stopped_early = false;       ///< Succeeded with fewer intervals than asked for.
  int finished_intervals = 0;       ///< The last of them has its checkpoint on disk.
  int queue_position = 0;           ///< 1 for the next job of those that wait, 0 for one that does not wait.
  std::string progress;             ///< The progress that was published last.
  std::string place;                ///< What its worker was about to do last; "": nothing it would have said.
  std::string died_at;              ///< The place at which a process last died that held the job.
  int deaths = 0;              ///< How many did so one after the other at this place, no interval finished in between.
  std::string result;          ///< Result of a job that succeeded. Empty in a list.
  std::optional<Error> error;  ///< Why the job failed; none unless `state` is failed.
  Time created{};
  std::optional<Time> started;  ///< When a worker first claimed it.
  std::optional<Time> ended;
};

/// "e000012" for 12, and back; nothing for a text that is no id.
[[nodiscard]] std::string id_of(std::int64_t number);
[[nodiscard]] std::optional<std::int64_t> number_of(std::string_view id);

/// How long a job lets shorter ones go first, in times of what it takes itself. A choice: as long as shorter jobs keep
/// the worker busy for less than three quarters of its time, no job comes to the end of this.
inline constexpr int stretch = 4;

/// So short are jobs that nobody minds in which order they come: the one in which they were handed in. A choice.
inline constexpr std::chrono::milliseconds negligible{500};

/// When it is a job's turn, by what it takes beyond what is negligible: a worker takes the job whose turn is earliest,
/// of those that can run, once none is left that was interrupted while it ran. A shorter job that is handed in within
/// `stretch` times what this one takes goes first; none that is handed in later does, so that each job's turn comes
/// however many shorter ones follow. Jobs of which nobody knows how long they take come in the order in which they were
/// handed in; so does one that is only to end and keep what it has.
[[nodiscard]] Time turn_of(const Job& job);

/// What can happen to a job. Its worker brings about all but `stop`, `cancel`, `requeue` and `abandon`: whoever finds
/// it claimed by a worker that is no more, or whose claim has run out, does the last.
enum class Event { claim, report, finish_interval, stop, cancel, succeed, fail, release, make_way, abandon, requeue };
inline constexpr int event_count = 11;

/// An event with its data; fields that do not belong to the event are ignored.
struct Change {
  Event event = Event::report;
  std::int64_t claim = 0;  ///< What a worker brings about after `claim` carries the number that it was given then.
  std::optional<std::string> progress = {};  ///< With any event: the record's new progress.
  std::optional<std::string> place = {};     ///< report: the record's new place.
  /// finish_interval: number of the interval, larger than any before; the first is 1. requeue: that of the checkpoint
  /// that is still there; 0: there is none.
  int interval = 0;
  std::string result = {};              ///< succeed: the record's result.
  bool stopped_early = false;           ///< succeed: the record's `stopped_early`.
  Error error = {};                     ///< fail: the record's error.
  int max_deaths = 0;                   ///< abandon: the job fails when its `deaths` come to so many; 0: never.
  std::string holder = {};              ///< claim: the record's holder.
  std::chrono::milliseconds worked{0};  ///< With any event of a worker: what it has worked since it last said so.
};

/// Whether the claim of this number holds the job.
///   errors  conflict: the job has ended, was given back, or has been taken over by another; `where` is the id
[[nodiscard]] Result<void> check_claim(const Job& job, std::int64_t claim);

/// The record after the change. Every store calls this function, so the rules are the same everywhere.
///   errors  conflict: not in this state (`where` is the id; the message says what to do instead), or by a worker that
///           does not hold the job any more: nothing it says counts; invalid_argument: finish_interval with a number
///           that does not count up
[[nodiscard]] Result<Job> transition(Job job, const Change& change, Time now);

}  // namespace engine::jobs
