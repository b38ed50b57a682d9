// Who may work in a folder: one process alone, or several that share it.
#pragma once

#include <chrono>
#include <filesystem>

#include "engine/core/file_descriptor.h"
#include "engine/core/result.h"

namespace server::scenes {

enum class Sharing {
  alone,  ///< One process has the folder.
  shared  ///< Several have it, perhaps on as many hosts; each looks at what the others have changed.
};

/// Held until it is destroyed, or its process ends, however it ends.
class FolderLock {
 public:
  FolderLock() = default;
  /// Locks the folder itself, which nobody removes while it holds scenes, and the file ".lock" in it, which is what
  /// earlier releases look at. Somebody who tidies up may remove the file; the folder's lock stays. The first of those
  /// who share it has it alone until share(): it can put things in order that nobody else works with yet. The others
  /// wait for that, but not longer than `patience`.
  ///   errors  conflict: another process has it, and does not share it; those of file_error()
  [[nodiscard]] static engine::Result<FolderLock> take(
      const std::filesystem::path& folder, Sharing sharing,
      std::chrono::milliseconds patience = std::chrono::milliseconds(10'000));
  [[nodiscard]] bool is_alone() const { return is_alone_; }
  /// Lets others in.
  void share();

 private:
  engine::FileDescriptor folder_, file_;
  bool is_alone_ = false;
};

}  // namespace server::scenes
