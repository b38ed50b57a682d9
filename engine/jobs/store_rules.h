// What all stores of job records say and decide alike, however they keep them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/jobs/store.h"

namespace engine::jobs {

/// An Error on its way from the depth of a store to the function that makes a Result of it.
struct StoreFailure : std::exception {
  explicit StoreFailure(Error e) : error(std::move(e)) {}
  Error error;
};

/// The name of a code in a row, and back. Names, because the numbers of an enum may change between versions and the row
/// stays.
[[nodiscard]] std::string_view code_name(ErrorCode code);
[[nodiscard]] std::optional<ErrorCode> parse_code(std::string_view name);

[[noreturn]] void no_such_job(const std::string& id);
/// The number of an id, or no_such_job().
[[nodiscard]] std::int64_t known_number(const std::string& id);
/// Throws where `waiting` jobs are as many as may wait.
void check_room(std::size_t waiting, std::size_t max_queued);
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
/// The jobs that wait, in the order of their turns, by number: 1 for the next one.
///   active  all that have not ended, by number
[[nodiscard]] std::map<std::int64_t, int> places_in_queue(const std::vector<ActiveJob>& active);

}  // namespace engine::jobs
