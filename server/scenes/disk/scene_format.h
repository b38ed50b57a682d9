// What a scene's file takes in memory.
#pragma once

#include <cstdint>
#include <filesystem>

#include "engine/core/result.h"
#include "engine/io/scene_file.h"

namespace server::scenes {

using engine::Result;

/// Bytes that reading a scene file will take, judged by its header: no less than memory_bytes() of what is read. 0 for
/// a file that cannot be read. A .sog or .glb file is in memory for that, within `work`.
[[nodiscard]] std::uint64_t expected_memory_bytes(const std::filesystem::path& file, engine::MemoryBudget* work);

/// Bytes that a scene holds, its file's layout included.
[[nodiscard]] std::uint64_t memory_bytes(const engine::io::SceneFile& file);

}  // namespace server::scenes
