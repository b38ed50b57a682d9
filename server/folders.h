// Folders for results.
#pragma once

#include <filesystem>

#include "engine/core/result.h"

namespace server {

/// Makes the folder and those above it, if they do not exist.
///   errors  invalid_argument: there is a file of that name; no_space; unavailable: not permitted, or else
[[nodiscard]] engine::Result<void> make_folder(const std::filesystem::path& path);

}  // namespace server
