// Where the tests' data is, and temporary folders.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

namespace support {

/// The project's own files.
std::filesystem::path source_dir();
/// Shared reference vectors: $SPLATDRAG_GOLDEN, or ../shared/golden beside the project.
std::filesystem::path golden_dir();
/// Shared real captures: $SPLATDRAG_DATA, or ../shared/data beside the project.
std::filesystem::path data_dir();

/// A new empty folder, removed with everything in it at the end of the scope.
class TempDir {
 public:
  TempDir();
  ~TempDir();
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

std::string read_file(const std::filesystem::path& path);
void write_file(const std::filesystem::path& path, const std::string& bytes);

}  // namespace support

/// Skips the test, saying why, when shared data is absent. In CI (CI is set) absent data is a failure.
#define REQUIRE_SHARED(path)                                                          \
  do {                                                                                \
    if (!std::filesystem::exists(path)) {                                             \
      if (std::getenv("CI") != nullptr) FAIL() << (path) << " is absent in CI";       \
      GTEST_SKIP() << (path) << " is absent: the shared data is not on this machine"; \
    }                                                                                 \
  } while (false)
