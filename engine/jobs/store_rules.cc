#include "engine/jobs/store_rules.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <utility>

namespace engine::jobs {
namespace {

/// In the order of ErrorCode.
constexpr std::array<std::string_view, 13> code_names = {
    "invalid_argument", "unprocessable", "not_found", "conflict",    "corrupt_data", "unsupported",   "too_large",
    "no_space",         "busy",          "cancelled", "unavailable", "internal",     "quota_exceeded"};
static_assert(std::size_t(ErrorCode::quota_exceeded) + 1 == code_names.size());

/// The jobs that wait, in the order of their turns, by number: 1 for the next one.
std::map<std::int64_t, int> places_in_queue(const std::vector<ActiveJob>& active) {
  struct Waiting {
    std::int64_t turn, number;
  };
  std::vector<Waiting> waiting;
  std::map<std::string_view, std::int64_t> last_turn;  // by lane: its jobs come in order, whatever each of them takes
  for (const ActiveJob& job : active) {
    std::int64_t& turn = last_turn.try_emplace(job.lane, job.turn).first->second;
    turn = std::max(turn, job.turn);
    if (job.waits) waiting.push_back({turn, job.number});
  }
  std::ranges::stable_sort(waiting, {}, &Waiting::turn);
  std::map<std::int64_t, int> places;
  for (const Waiting& job : waiting) places.emplace(job.number, int(places.size()) + 1);
  return places;
}

}  // namespace

std::string_view code_name(ErrorCode code) { return code_names[std::size_t(code)]; }

std::optional<ErrorCode> parse_code(std::string_view name) {
  const auto found = std::find(code_names.begin(), code_names.end(), name);
  if (found == code_names.end()) return std::nullopt;
  return ErrorCode(std::distance(code_names.begin(), found));
}

void no_such_job(const std::string& id) {
  throw StoreFailure(
      {ErrorCode::not_found, "there is no job \"" + id + "\"; ended ones are removed after a while", id});
}

std::int64_t known_number(const std::string& id) {
  const auto number = number_of(id);
  if (!number) no_such_job(id);
  return *number;
}

void check_room(std::size_t waiting, std::size_t max_queued) {
  if (waiting < max_queued) return;
  throw StoreFailure({ErrorCode::busy,
                      "the queue is full: " + std::to_string(waiting) + " jobs wait, its limit (max_queued) is " +
                          std::to_string(max_queued) + "; try again later",
                      "max_queued"});
}

void check_quota(const Usage& usage, const NewJob& job) {
  const auto seconds = [](std::chrono::milliseconds time) {
    return std::to_string(std::chrono::ceil<std::chrono::seconds>(time).count()) + " s";
  };
  if (job.quota.active && usage.active >= *job.quota.active)
    throw StoreFailure({ErrorCode::quota_exceeded,
                        job.requester + " has " + std::to_string(usage.active) + " of " +
                            std::to_string(*job.quota.active) +
                            " that may wait or run at a time: wait for one to end, or cancel one",
                        "active"});
  if (job.quota.worked_per_day && job.expected > *job.quota.worked_per_day)
    throw StoreFailure({ErrorCode::too_large,
                        "this should take " + seconds(job.expected) + " of work, and " + job.requester + " may have " +
                            seconds(*job.quota.worked_per_day) + " a day: it fits on no day, ask for less",
                        "worked_per_day"});
  const auto promised = usage.worked_today + usage.expected;
  if (job.quota.worked_per_day && promised + job.expected > *job.quota.worked_per_day)
    throw StoreFailure({ErrorCode::quota_exceeded,
                        job.requester + " may have " + seconds(*job.quota.worked_per_day) + " of work a day (UTC): " +
                            seconds(usage.worked_today) + " are used, what waits and runs should take " +
                            seconds(usage.expected) + ", and this " + seconds(job.expected),
                        "worked_per_day"});
}

void check_is_last_of_lane(const Job& job, std::span<const std::string> younger) {
  if (job.state != JobState::failed || younger.empty()) return;
  throw StoreFailure(
      {ErrorCode::conflict,
       younger.front() + " came after " + job.id + " in its lane and has yet to end: wait for it, or cancel it",
       job.id});
}

std::int64_t day_of(Time time) { return std::chrono::floor<std::chrono::days>(time).time_since_epoch().count(); }

Submission same_submission(Job earlier, const NewJob& job) {
  if (earlier.payload != job.payload || earlier.lane != job.lane)
    throw StoreFailure({ErrorCode::unprocessable,
                        "this idempotency key came with another request before, job " + earlier.id +
                            ": use a new key for a new request",
                        "idempotency_key"});
  return {.job = std::move(earlier), .created = false};
}

void check_owner_of_key(const std::optional<Job>& owner, const Job& restored) {
  if (owner && owner->id != restored.id)
    throw StoreFailure({ErrorCode::conflict, owner->id + " has the idempotency key of " + restored.id, restored.id});
}

void check_has_ended(const Job& job) {
  if (is_final(job.state)) return;
  throw StoreFailure({ErrorCode::conflict,
                      job.id + " is " + std::string(to_string(job.state)) + ": cancel it and wait for its end first",
                      job.id});
}

void give_places(std::span<Job> jobs, const std::function<std::vector<ActiveJob>()>& active) {
  const auto waits = [](const Job& job) { return job.state == JobState::queued; };
  if (std::ranges::none_of(jobs, waits)) return;
  const auto places = places_in_queue(active());
  for (Job& job : jobs)
    if (const auto place = places.find(number_of(job.id).value_or(0)); waits(job) && place != places.end())
      job.queue_position = place->second;
}

}  // namespace engine::jobs
