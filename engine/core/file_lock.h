// A lock between processes, of one host or of several that share a folder.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <utility>

#include "engine/core/file_descriptor.h"
#include "engine/core/result.h"

namespace engine {

enum class LockKind {
  shared,  ///< Any number may hold it together.
  alone    ///< Nobody else holds it.
};

/// A numbered lock of a file, held until this is destroyed or its process ends, however it ends. A lock of a byte
/// (fcntl, of an open file description): network file systems have them, and threads keep each other out as processes
/// do. A process that is halted goes on holding it.
class FileLock {
 public:
  /// Waits for the lock, but not longer than `patience`. Waiting is not fair.
  ///   file    made if it is not there; stays
  ///   errors  busy: others hold it; those of file_error()
  [[nodiscard]] static Result<FileLock> take(const std::filesystem::path& file, std::uint64_t number, LockKind kind,
                                             std::chrono::milliseconds patience);

 private:
  explicit FileLock(FileDescriptor opened) : opened_(std::move(opened)) {}
  FileDescriptor opened_;
};

}  // namespace engine
