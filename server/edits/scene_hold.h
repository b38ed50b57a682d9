// Keeps an edit that is accepted, or taken up again, and a change of its scene apart, among all processes of a data
// folder.
#pragma once

#include <filesystem>
#include <string>

#include "engine/core/file_lock.h"

namespace server::edits {

/// Waits a while for the others.
///   folder  <data-dir>/edits
///   kind    shared: of an edit; alone: of a change of the scene
///   errors  conflict: others did not end in time (`where` is the scene); those of FileLock::take()
[[nodiscard]] engine::Result<engine::FileLock> hold_scene(const std::filesystem::path& folder, const std::string& scene,
                                                          engine::LockKind kind);

}  // namespace server::edits
