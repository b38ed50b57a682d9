// What a scene's file takes in memory.
#pragma once

#include <cstdint>
#include <filesystem>

#include "engine/core/result.h"
#include "engine/io/scene_file.h"

namespace server::scenes {

using engine::Result;

/// Bytes that reading a scene file will take, judged by its header: no less than memory_bytes() of what is read. 0 for
/// a file that cannot be read. A .sog or .glb file and its JSON are in memory for that, within options.memory: one call
/// at a time.
[[nodiscard]] std::uint64_t expected_memory_bytes(const std::filesystem::path& file,
                                                  const engine::io::ReadOptions& options);

/// Bytes that a scene holds, its file's layout included.
[[nodiscard]] std::uint64_t memory_bytes(const engine::io::SceneFile& file);

}  // namespace server::scenes
