// One process at a time in a folder.
#pragma once

#include <filesystem>

#include "engine/core/file_descriptor.h"
#include "engine/core/result.h"

namespace server::scenes {

/// Held until it is destroyed, or its process ends, however it ends.
class FolderLock {
 public:
  FolderLock() = default;
  /// Locks the folder itself, which nobody removes while it holds scenes, and the file ".lock" in it, which is what
  /// earlier releases look at. Somebody who tidies up may remove the file; the folder's lock stays.
  ///   errors  conflict: another process has it; those of file_error()
  [[nodiscard]] static engine::Result<FolderLock> take(const std::filesystem::path& folder);

 private:
  engine::FileDescriptor folder_, file_;
};

}  // namespace server::scenes
