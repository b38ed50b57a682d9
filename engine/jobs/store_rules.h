// What all stores of job records say and decide alike, however they keep them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "engine/jobs/store.h"

namespace engine::jobs {

/// An Error on its way from the depth of a store to the function that makes a Result of it.
struct StoreFailure : std::exception {
  explicit StoreFailure(Error e) : error(std::move(e)) {}
  Error error;
};

/// Runs `body` and turns what is thrown into an Error.
template <class Body>
auto guarded(Body body) -> Result<decltype(body())> {
  try {
    if constexpr (std::is_void_v<decltype(body())>) {
      body();
      return {};
    } else {
      return body();
    }
  } catch (const StoreFailure& failure) {
    return tl::make_unexpected(failure.error);
  } catch (const std::exception& e) {
    return fail(ErrorCode::internal, std::string("job store: ") + e.what());
  }
}

/// The name of a code in a row, and back. Names, because the numbers of an enum may change between versions and the row
/// stays.
[[nodiscard]] std::string_view code_name(ErrorCode code);
[[nodiscard]] std::optional<ErrorCode> parse_code(std::string_view name);

[[noreturn]] void no_such_job(const std::string& id);
/// The number of an id, or no_such_job().
[[nodiscard]] std::int64_t known_number(const std::string& id);
/// Throws where `waiting` jobs are as many as may wait.
void check_room(std::size_t waiting, std::size_t max_queued);
/// Whether the quota limits anything: else there is nothing to count.
[[nodiscard]] inline bool has_limit(const Quota& quota) { return quota.active || quota.worked_per_day; }
/// Throws where the requester's quota has no room for the job, or never has.
void check_quota(const Usage& usage, const NewJob& job);
/// Throws where the lane of a failed job, which is to be taken up again, has younger ones that have yet to end: one may
/// run, and two of a lane never do. Of a job that has not failed there is nothing to say here.
///   younger  ids of any of these
void check_is_last_of_lane(const Job& job, std::span<const std::string> younger);
/// The day since 1970, UTC.
[[nodiscard]] std::int64_t day_of(Time time);
/// Days of the use of quotas that are kept. A choice: what has been used shows for a while.
inline constexpr std::int64_t days_kept = 40;
/// The job that came with this idempotency key before, as the answer to one that comes with it now.
[[nodiscard]] Submission same_submission(Job earlier, const NewJob& job);
/// Throws where a job that is restored has the idempotency key of this one.
void check_owner_of_key(const std::optional<Job>& owner, const Job& restored);
/// Throws where the job has not ended.
void check_has_ended(const Job& job);

/// What of a job that has not ended says when its turn comes.
struct ActiveJob {
  std::int64_t number = 0;
  std::string lane;
  bool waits = false;  ///< It is queued.
  std::int64_t turn = 0;
};
/// Gives each of the jobs that waits its place among all that wait, by their turns: 1 for the next one.
///   active  all that have not ended, by number; asked for only where a job waits
void give_places(std::span<Job> jobs, const std::function<std::vector<ActiveJob>()>& active);

}  // namespace engine::jobs
