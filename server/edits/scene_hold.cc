#include "server/edits/scene_hold.h"

#include <chrono>

#include "engine/core/numbers.h"

namespace server::edits {
namespace {

/// So long a change of a scene waits for edits that are being accepted, and those for it, in other processes. A choice:
/// an edit is mostly accepted within one.
constexpr auto others_are_done_within = std::chrono::seconds(10);

}  // namespace

engine::Result<engine::FileLock> hold_scene(const std::filesystem::path& folder, const std::string& scene,
                                            engine::LockKind kind) {
  auto lock = engine::FileLock::take(folder / "scenes_in_use", engine::number_of_id('s', scene).value_or(0), kind,
                                     others_are_done_within);
  if (lock || lock.error().code != engine::ErrorCode::busy) return lock;
  return engine::fail(engine::ErrorCode::conflict,
                      kind == engine::LockKind::alone ? "an edit of this scene is just being accepted: wait for its end"
                                                      : "this scene is just being changed: try again",
                      scene);
}

}  // namespace server::edits
