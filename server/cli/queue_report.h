// What splatdrag admin tells of the queue: tables for people, JSON for programs.
#pragma once

#include <string>

#include "server/edits/operation.h"

namespace server::cli {

/// A line for each edit, under a line of headings; one sentence where there is none.
[[nodiscard]] std::string queue_table(const edits::QueueLook& look);
/// The same for those that a worker has: who, what, since when, for how long still.
[[nodiscard]] std::string workers_table(const edits::QueueLook& look);

/// {"edits":[{"id","scene","state","token","place","age_seconds","expected_seconds","worked_seconds",
/// "finished_intervals","deaths","died_at","claim":{"worker","number","since_seconds","lease_seconds"},"error"}],
/// "in_use"}: what is not known is null.
[[nodiscard]] std::string queue_json(const edits::QueueLook& look);
/// {"workers":[{"worker","edit","scene","claim","since_seconds","lease_seconds","deaths","finished_intervals"}],
/// "in_use"}
[[nodiscard]] std::string workers_json(const edits::QueueLook& look);

/// "90 s", "12 min", "5 h", "3 d"
[[nodiscard]] std::string short_time(double seconds);

}  // namespace server::cli
