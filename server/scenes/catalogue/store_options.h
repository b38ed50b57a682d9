// What a scene store is opened with.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "engine/io/read_options.h"
#include "server/scenes/catalogue/scene_info.h"

namespace server::scenes {

struct StoreOptions {
  std::filesystem::path folder;                              ///< <data-dir>/scenes
  std::filesystem::path scene_root;                          ///< Files may be opened below it; empty: none may.
  std::uint64_t memory_bytes = std::uint64_t{4} << 30;       ///< Budget of clouds, overlays and previews in memory.
  std::uint64_t max_dataset_bytes = std::uint64_t{8} << 30;  ///< Unpacked.
  std::size_t max_dataset_files = 20'000;
  std::uint64_t file_cache_bytes = std::uint64_t{8} << 30;  ///< Of versions written for download; those in use may
                                                            ///< exceed it.
  std::size_t max_scenes = 1000;
  std::size_t max_previews = 16;
  std::chrono::seconds preview_lifetime{600};  ///< Since it was last looked at.
  engine::io::ReadOptions read = {};           ///< Its max_memory_bytes becomes `memory_bytes`.
  std::string program_version = {};  ///< Part of all keys: another version may write or draw a scene differently.
  std::function<Time()> clock = {};  ///< Empty: the machine's.
};

}  // namespace server::scenes
