// The queue's files: whole after a power cut, or not there at all. What is said of one that cannot be written names no
// folder, and says no more than no_space or unavailable: both may be over in a moment.
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

///   errors  not_found, unavailable; `where` is the file
[[nodiscard]] Result<std::string> read_bytes(const std::filesystem::path& file);

}  // namespace engine::jobs
