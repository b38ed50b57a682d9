// Errors as strangers may read them: without the paths of this machine.
#pragma once

#include <filesystem>
#include <utility>
#include <vector>

#include "engine/core/result.h"

namespace server::scenes {

/// Paths below the folder become relative to it, the folder itself becomes its name: "/srv/scenes/s000001/base.ply" is
/// "s000001/base.ply". Other paths stay as they are.
///   folder  absolute, as errors spell it
[[nodiscard]] engine::Error without_folder(engine::Error error, const std::filesystem::path& folder);

/// Words errors on their way out of the store: without its folders, and with the engine's limits called as the
/// service's options are.
class PublicErrors {
 public:
  explicit PublicErrors(std::vector<std::filesystem::path> folders) : folders_(std::move(folders)) {}

  /// A failure as strangers may read it.
  ///   within  folder that paths are made relative to first, if given
  template <class T>
  [[nodiscard]] tl::unexpected<engine::Error> operator()(const engine::Result<T>& failed,
                                                         const std::filesystem::path& within = {}) const {
    return (*this)(failed.error(), within);
  }
  [[nodiscard]] tl::unexpected<engine::Error> operator()(engine::Error error,
                                                         const std::filesystem::path& within = {}) const;

 private:
  std::vector<std::filesystem::path> folders_;
};

}  // namespace server::scenes
