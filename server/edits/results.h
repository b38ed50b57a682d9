// What edits have made: a file that nobody sees, until the edit's record says that it has succeeded; then a version of
// its scene. So the record alone decides, which refuses whoever does not hold the edit any more: a worker that was
// halted for longer than its claim lasts, and wakes at whatever moment, has made nothing that others see.
#pragma once

#include <cstdint>
#include <string>

#include "engine/jobs/queue.h"
#include "server/scenes/scene_store.h"

namespace server::edits {

using engine::Result;

/// Makes what an edit that has succeeded has made a version of its scene. Nothing where that was done before, by
/// whatever process, or where the scene is gone; nothing for an edit that has not succeeded.
///   job     the whole record
///   errors  those of SceneStore::take_in()
[[nodiscard]] Result<void> take_in_result(scenes::SceneStore& scenes, const engine::jobs::Job& job);

/// The same for all that waits, whoever has made it, and drops what no edit that runs or has succeeded will want.
/// Called at the start, and before a version gets its number: the one before has to have its own by then.
void settle_results(scenes::SceneStore& scenes, engine::jobs::Queue& queue);

/// Drops what the attempts at an edit have made, up to that of this claim: it may have been taken up again since, and
/// what a later one makes is still wanted.
void drop_results(scenes::SceneStore& scenes, const std::string& edit, std::int64_t claim);

}  // namespace server::edits
