// A folder outside of the data folder, for copies to be looked at.
#pragma once

#include <filesystem>
#include <string>
#include <utility>

#include "engine/core/result.h"

namespace server::edits {

/// Is gone when this is. Nobody but the user of this process can look into it.
class TemporaryFolder {
 public:
  ///   name    what its name begins with
  ///   errors  those of engine::file_error()
  [[nodiscard]] static engine::Result<TemporaryFolder> make(const std::string& name);
  TemporaryFolder(TemporaryFolder&& other) noexcept : path_(std::exchange(other.path_, {})) {}
  TemporaryFolder& operator=(TemporaryFolder&&) = delete;
  ~TemporaryFolder();
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  explicit TemporaryFolder(std::filesystem::path path) : path_(std::move(path)) {}
  std::filesystem::path path_;
};

}  // namespace server::edits
