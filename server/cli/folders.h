// Folders that commands write their results to.
#pragma once

#include <filesystem>

#include "engine/core/result.h"

namespace server::cli {

/// Makes the folder and those above it, if they do not exist.
///   errors  invalid_argument: there is a file of that name; no_space; unavailable: not permitted, or else
[[nodiscard]] engine::Result<void> make_folder(const std::filesystem::path& path);

/// Refuses to write over what a result is made from. Neither file needs to exist.
///   errors  conflict: both are the same file
[[nodiscard]] engine::Result<void> keep_input_safe(const std::filesystem::path& input,
                                                   const std::filesystem::path& output);

}  // namespace server::cli
