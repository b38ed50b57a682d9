// Which format a scene file is in, and what one takes in memory.
#pragma once

#include <cstdint>
#include <filesystem>

#include "engine/core/result.h"
#include "engine/io/scene_file.h"

namespace server::scenes {

using engine::Result;

struct SceneFormat {
  const char* name;       ///< "ply", "compressed_ply", "spz", "splat"
  const char* extension;  ///< "ply", "spz", "splat"
};

/// The format of a file that io::read_scene() reads.
///   errors  those of InputFile
[[nodiscard]] Result<SceneFormat> detect_format(const std::filesystem::path& file);

/// Bytes that reading a scene file will take, judged by its header: no less than memory_bytes() of what is read. 0 for
/// a file that cannot be read.
[[nodiscard]] std::uint64_t expected_memory_bytes(const std::filesystem::path& file);

/// Bytes that a scene holds, its file's layout included.
[[nodiscard]] std::uint64_t memory_bytes(const engine::io::SceneFile& file);

}  // namespace server::scenes
