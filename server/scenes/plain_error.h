// Errors as strangers may read them: without the paths of this machine.
#pragma once

#include <filesystem>

#include "engine/core/result.h"

namespace server::scenes {

/// Paths below the folder become relative to it, the folder itself becomes its name: "/srv/scenes/s000001/base.ply" is
/// "s000001/base.ply". What is said of other places stays.
///   folder  absolute, as errors spell it
[[nodiscard]] engine::Error without_folder(engine::Error error, const std::filesystem::path& folder);

}  // namespace server::scenes
