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
#include "server/scenes/disk/folder_lock.h"

namespace server::scenes {

/// Where the store is and how much it may hold.
struct StoreOptions {
  std::filesystem::path folder;  ///< <data-dir>/scenes
  Sharing sharing = Sharing::alone;
  std::filesystem::path scene_root;                          ///< Files may be opened below it; empty: none may.
  std::uint64_t memory_bytes = std::uint64_t{4} << 30;       ///< Budget of clouds, overlays and previews in memory.
  std::uint64_t max_dataset_bytes = std::uint64_t{8} << 30;  ///< Of one dataset, unpacked.
  std::size_t max_dataset_files = 20'000;
  std::uint64_t file_cache_bytes = std::uint64_t{8} << 30;  ///< Budget of versions written for download; files in
                                                            ///< use may exceed it.
  std::size_t max_scenes = 1000;
  std::size_t max_previews = 16;
  std::chrono::seconds preview_lifetime{600};  ///< Time since somebody last looked at it.
  engine::io::ReadOptions read = {};           ///< The store sets max_memory_bytes to `memory_bytes`.
  std::string program_release = {};  ///< Part of all keys: another release may write or draw a scene differently.
  std::function<Time()> clock = {};  ///< Tells the time; empty: the machine's clock.
};

}  // namespace server::scenes
