// A whole file in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "engine/core/result.h"

namespace engine::io {

/// The bytes of a file.
///   errors  those of InputFile; too_large: more than `limit` bytes, or than memory holds
[[nodiscard]] Result<std::vector<std::byte>> read_bytes(const std::filesystem::path& path, std::uint64_t limit);

}  // namespace engine::io
