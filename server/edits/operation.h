// What an operator asks of the queue from beside the service: which edits wait, who works on what; and what may be set
// going again. The records are looked at as they are, whether or not a service is at work on them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"

namespace server::edits {

using engine::Result;

/// An edit that waits, runs or has failed. Times are seconds before now, by the clock of the records.
struct EditAtHand {
  std::string id, scene;
  std::string state;                    ///< "queued", "running", ..., "failed"
  std::string token = {};               ///< Name of the token that asked for it; empty: there was none.
  int place = 0;                        ///< 1 for the next one of those that wait; 0: it does not wait.
  double age = 0;                       ///< Since it was accepted.
  std::optional<double> expected = {};  ///< What it should take in all, seconds.
  double worked = 0;                    ///< What it has taken so far, seconds.
  int finished_intervals = 0;
  int deaths = 0;            ///< How often in a row a process has died at it, at one place.
  std::string died_at = {};  ///< That place.
  struct Claim {
    std::string worker = {};           ///< "HOST:PROCESS"; empty: it did not say.
    std::int64_t number = 0;           ///< Counts the claims of the edit.
    std::optional<double> since = {};  ///< Since it was made.
    std::optional<double> lease_left =
        {};  ///< Seconds until others may take it over; below 0 they may. None: it does not end.
  };
  std::optional<Claim> claim = {};  ///< Of the worker that has it; none: nobody has.
  std::string error = {};           ///< Why it failed.
};

struct QueueLook {
  /// Those in work, those that wait, in their turn, then, if asked for, those that have failed, the youngest first.
  std::vector<EditAtHand> edits = {};
  /// Records in a file alone: whether a service has it open, as far as that can be told. Else claims are those of one
  /// that has ended.
  std::optional<bool> in_use = {};
};

///   folder       <data-dir>/edits
///   store        as of ServiceOptions
///   with_failed  the failed edits on record are listed, too
///   errors  not_found: there are no records; conflict: they are kept elsewhere; those of copy_sqlite_store() and
///           PostgresStore::open()
[[nodiscard]] Result<QueueLook> look_at_queue(const std::filesystem::path& folder, const std::string& store,
                                              bool with_failed);

/// Has an edit that failed taken up again, from its last checkpoint, if there is one and it can still be used; the
/// deaths of its workers are forgotten. Whether scene and version are still there shows when it is carried out.
///   returns  the edit, as it waits now
///   errors   conflict: it has not failed, or a later edit of its scene has yet to end, or the scene is just being
///            changed; unavailable: a service has the records open, which has to be asked itself (POST
///            /v1/edits/{id}/requeue); those of look_at_queue()
[[nodiscard]] Result<EditAtHand> requeue_edit(const std::filesystem::path& folder, const std::string& store,
                                              const std::string& id);

}  // namespace server::edits
