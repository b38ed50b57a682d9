// Folders for what is on its way into the store.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>

#include "engine/core/result.h"
#include "server/scenes/disk/public_errors.h"

namespace server::scenes {

using engine::Result;

/// A folder that is gone, with all in it, when this is.
class Scratch {
 public:
  explicit Scratch(std::filesystem::path folder) : folder_(std::move(folder)) {}
  ~Scratch();
  Scratch(Scratch&& other) noexcept : folder_(std::exchange(other.folder_, {})) {}
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

 private:
  std::filesystem::path folder_;
};

/// Safe to call from any thread.
class ScratchFolders {
 public:
  /// folder        holds them all
  /// prefix        of their names; that of another process is another one
  /// public_error  outlives this
  ScratchFolders(std::filesystem::path folder, std::string prefix, const PublicErrors& public_error)
      : folder_(std::move(folder)), prefix_(std::move(prefix)), public_error_(public_error) {}

  /// Makes that folder.
  ///   is_alone  no other process uses it: what an earlier one left in it goes
  ///   errors    those of make_folder()
  [[nodiscard]] Result<void> open(bool is_alone);
  /// A new, empty folder.
  ///   errors  those of make_folder()
  [[nodiscard]] Result<Scratch> make();

 private:
  const std::filesystem::path folder_;
  const std::string prefix_;
  const PublicErrors& public_error_;
  std::atomic<std::uint64_t> last_{0};
};

}  // namespace server::scenes
