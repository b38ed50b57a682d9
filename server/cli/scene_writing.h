// Scenes that a command writes in a format of the user's choice.
#pragma once

#include <filesystem>

#include "engine/core/result.h"
#include "engine/io/scene_file.h"
#include "server/cli/terminal.h"

namespace server::cli {

/// Writes the scene, and warns of what the format loses of it: before, what it has no place for; afterwards, in
/// numbers, what it has rounded, for which all but a .ply is read again.
///   errors  those of engine::io::write_scene() and engine::io::read_scene()
[[nodiscard]] engine::Result<void> write_and_tell(const std::filesystem::path& file, const engine::io::SceneFile& scene,
                                                  engine::io::SceneFormat format, Terminal& terminal);

}  // namespace server::cli
