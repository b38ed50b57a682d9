// Files that are there, whole, after a power cut, or not at all.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace engine::jobs {

/// Makes the folder and those above it, and waits until they are on disk. One that exists is left as it is.
///   errors  no_space, unavailable; `where` is the folder
[[nodiscard]] Result<void> create_folder(const std::filesystem::path& folder);

/// Writes the file under a temporary name, waits until it is on disk, renames it: a reader sees the old bytes or the
/// new ones, even after a power cut. The folder must exist.
///   errors  no_space: what was there before is unchanged; unavailable; `where` is the file
[[nodiscard]] Result<void> write_durably(const std::filesystem::path& file, std::string_view bytes);

///   errors  not_found, unavailable; `where` is the file
[[nodiscard]] Result<std::string> read_bytes(const std::filesystem::path& file);

/// Whether this errno says that there is no room: disk full, quota used up, file larger than allowed.
[[nodiscard]] bool means_no_space(int error_number);

}  // namespace engine::jobs
