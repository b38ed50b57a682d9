// Holds a store of records against the notes of its jobs.
#pragma once

#include <filesystem>
#include <vector>

#include "engine/jobs/store.h"

namespace engine::jobs {

/// Makes both say the same, before anybody works with them. A job that the store does not know is put back, at its last
/// checkpoint; one that had ended, as it ended. What the notes lack is noted. A removal that was cut short is finished.
/// The folders of cancelled jobs go. A folder that neither knows is left alone: somebody may want to save it.
///   returns  what was amiss, for the log; `where` is the job's id
///   errors   those of the store, no_space, unavailable
[[nodiscard]] Result<std::vector<Error>> reconcile(Store& store, const std::filesystem::path& folder);

}  // namespace engine::jobs
