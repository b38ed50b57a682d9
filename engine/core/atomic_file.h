// Files that appear whole or not at all, and are there after a power cut.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "engine/core/file_descriptor.h"
#include "engine/core/result.h"

namespace engine {

/// What is said of a system call that failed: file_error(), unless a room has words of its own. Same arguments.
using FileErrorOf = Error (*)(int error_number, const std::string& action, const std::filesystem::path& path);

/// How the names of temporary files begin: ".splatdrag-<pid>-<n>.tmp". A process that is killed leaves them.
constexpr const char* temporary_prefix = ".splatdrag-";

/// Writes to a temporary name in the folder of `path`; commit() makes it durable and moves it to `path`, replacing what
/// is there. Destroyed without commit(), after any error, it leaves nothing behind and `path` as it was; only if the
/// folder cannot be synced at the very end, `path` is the new file, and a power cut may still take it back.
///   errors  no_space, not_found (no such folder), invalid_argument (`path` is a folder), unavailable (not permitted)
class AtomicFile {
 public:
  [[nodiscard]] static Result<AtomicFile> create(const std::filesystem::path& path, FileErrorOf error_of = file_error);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;
  ~AtomicFile();

  [[nodiscard]] Result<void> write(std::span<const std::byte> bytes);
  /// Once, at the end: file contents to disk, rename, folder entry to disk.
  [[nodiscard]] Result<void> commit();

 private:
  AtomicFile(FileDescriptor fd, std::filesystem::path path, std::filesystem::path temporary, FileErrorOf error_of);
  [[nodiscard]] tl::unexpected<Error> failed() const;

  FileDescriptor fd_;
  std::filesystem::path path_;
  std::filesystem::path temporary_;  ///< Empty once committed or moved from.
  FileErrorOf error_of_;
};

/// All of a file in one call.
[[nodiscard]] Result<void> write_file(const std::filesystem::path& path, std::span<const std::byte> bytes,
                                      FileErrorOf error_of = file_error);

/// Waits until the names in a folder are on disk; an empty path is the working directory.
[[nodiscard]] Result<void> sync_folder(const std::filesystem::path& folder, FileErrorOf error_of = file_error);

}  // namespace engine
