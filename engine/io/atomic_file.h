// Files that appear whole or not at all.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

#include "engine/core/result.h"
#include "engine/io/file_descriptor.h"

namespace engine::io {

/// Writes to a temporary name in the folder of `path`; commit() makes it durable and moves it to `path`, replacing what
/// is there. Destroyed without commit(), after any error, it leaves nothing behind and `path` as it was. (A process
/// that is killed leaves a temporary called ".splatdrag-<pid>-<n>.tmp".)
///   errors  no_space, not_found (no such folder), invalid_argument (`path` is a folder), unavailable (not permitted)
class AtomicFile {
 public:
  [[nodiscard]] static Result<AtomicFile> create(const std::filesystem::path& path);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;
  ~AtomicFile();

  [[nodiscard]] Result<void> write(std::span<const std::byte> bytes);
  /// Once, at the end: file contents to disk, rename, folder entry to disk.
  [[nodiscard]] Result<void> commit();

 private:
  AtomicFile(FileDescriptor fd, std::filesystem::path path, std::filesystem::path temporary);

  FileDescriptor fd_;
  std::filesystem::path path_;
  std::filesystem::path temporary_;  ///< Empty once committed or moved from.
};

/// All of a file in one call.
[[nodiscard]] Result<void> write_file(const std::filesystem::path& path, std::span<const std::byte> bytes);

}  // namespace engine::io
