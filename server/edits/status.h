// An edit as its readers see it, from the job that carries it out.
#pragma once

#include "engine/jobs/job.h"
#include "proto/edit_status.h"

namespace server::edits {

/// job  with its payload, as Queue::find() gives it
[[nodiscard]] proto::EditStatus status_of(const engine::jobs::Job& job);

}  // namespace server::edits
