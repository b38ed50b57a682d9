// Folders for what is on its way into the store.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <utility>

#include "engine/core/result.h"
#include "server/scenes/disk/plain_error.h"

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
  /// folder  of them all
  /// told    outlives this
  ScratchFolders(std::filesystem::path folder, const PlainErrors& told) : folder_(std::move(folder)), told_(told) {}

  /// Makes the folder of them all, without what an earlier run left in it. Errors those of make_folder().
  [[nodiscard]] Result<void> open();
  /// A new, empty one. Errors those of make_folder().
  [[nodiscard]] Result<Scratch> make();

 private:
  const std::filesystem::path folder_;
  const PlainErrors& told_;
  std::atomic<std::uint64_t> last_{0};
};

}  // namespace server::scenes
