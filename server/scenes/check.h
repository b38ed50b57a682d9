// Goes over all that a store has on disk, without changing any of it.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "engine/core/result.h"

namespace server::scenes {

using engine::Result;

struct StoreCheck {
  std::vector<engine::Error> damaged;  ///< `where` is the file's path inside the data folder.
  std::vector<std::string> unchecked;  ///< Files that nothing is known of, stored by a release without checksums.
  std::size_t files = 0;               ///< Looked at.
};

/// Reads every file that a manifest names and holds it against its digest.
///   folder   <data-dir>/scenes; need not exist
///   errors   conflict: a service is at work on it; those of file_error()
[[nodiscard]] Result<StoreCheck> check_store(const std::filesystem::path& folder);

}  // namespace server::scenes
