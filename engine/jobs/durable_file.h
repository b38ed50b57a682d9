// The queue's files: after a power cut a file is whole or not there at all. The error for a file that cannot be written
// is no_space or unavailable, both of which may pass by themselves; its message names no folder.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace engine::jobs {

/// Makes the folder and those above it, and waits until they are on disk. One that exists is left as it is.
///   errors  no_space, unavailable; `where` is the folder
[[nodiscard]] Result<void> create_folder(const std::filesystem::path& folder);

/// Writes a file through AtomicFile: a reader sees the old bytes or the new ones, even after a power cut. The folder
/// must exist.
///   errors  no_space: what was there before is unchanged; unavailable; `where` is the file
[[nodiscard]] Result<void> write_durably(const std::filesystem::path& file, std::string_view bytes);

/// Reads a whole file.
///   errors  not_found, unavailable; `where` is the file
[[nodiscard]] Result<std::string> read_bytes(const std::filesystem::path& file);

}  // namespace engine::jobs
