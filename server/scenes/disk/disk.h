// Folders and files that survive a power cut, or vanish as a whole.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <utility>

#include "engine/core/result.h"

namespace server::scenes {

using engine::Result;

/// Makes the folder and those above it. One that exists is left as it is.
///   errors  those of file_error()
[[nodiscard]] Result<void> make_folder(const std::filesystem::path& folder);

/// Waits until a file's bytes are on disk.
[[nodiscard]] Result<void> sync_file(const std::filesystem::path& file);
/// Waits until everything written to the file system that holds `folder` is on disk: for folders of thousands of files,
/// each of which would otherwise cost a wait of its own.
[[nodiscard]] Result<void> sync_file_system(const std::filesystem::path& folder);

/// Renames within a file system and waits until both folders know it. What is moved is on disk already.
[[nodiscard]] Result<void> move_durably(const std::filesystem::path& from, const std::filesystem::path& to);

/// Gives a file that is on disk a second name, and waits until that is, too; what had the name before is replaced. A
/// copy where the file system has no such names.
[[nodiscard]] Result<void> link_durably(const std::filesystem::path& from, const std::filesystem::path& to);

/// A new file with the bytes of another one, which may grow or shrink meanwhile: what was there at some time is copied.
/// On disk when this returns; on an error nothing is left.
[[nodiscard]] Result<void> copy_file(const std::filesystem::path& from, const std::filesystem::path& to);

/// Tells one file of a name from the next one, and from itself once it has been written to. Looks at the file itself,
/// not at what a network file system remembers of it.
struct FileStamp {
  std::uint64_t inode = 0, bytes = 0;
  std::int64_t written_ns = 0, changed_ns = 0;
  bool operator==(const FileStamp&) const = default;
};
///   errors  those of file_error()
[[nodiscard]] Result<FileStamp> stamp_of(const std::filesystem::path& file);
/// Whether a change from now on shows in the stamp: within one tick of the file system's clock it might not.
[[nodiscard]] bool is_settled(const FileStamp& stamp);

/// Bytes of all regular files below a folder, or of the file itself; 0 for what cannot be read. Follows no link.
[[nodiscard]] std::uint64_t bytes_below(const std::filesystem::path& path);

/// Removes a file or a folder with all in it; what cannot be removed stays, to be removed at the next start.
void remove_quietly(const std::filesystem::path& path) noexcept;
/// The same, under another name beginning with removed_prefix: should we be killed half-way, what is left cannot be
/// taken for the whole.
void remove_renamed(const std::filesystem::path& path) noexcept;
constexpr const char* removed_prefix = ".removed-";

/// Something on disk that may have to outlive its removal: whoever still reads it holds this, and the last one to let
/// go removes it.
class Lease {
 public:
  explicit Lease(std::filesystem::path path) : path_(std::move(path)) {}
  ~Lease();
  Lease(const Lease&) = delete;
  Lease& operator=(const Lease&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// To be removed once nobody holds it.
  void end() noexcept { ended_ = true; }

 private:
  std::filesystem::path path_;
  std::atomic<bool> ended_{false};
};

}  // namespace server::scenes
