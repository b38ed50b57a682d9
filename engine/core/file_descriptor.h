// An open file, and what the operating system says when something goes wrong with one.
#pragma once

#include <filesystem>
#include <string>
#include <utility>

#include "engine/core/result.h"

namespace engine {

/// Owns an open POSIX file descriptor; -1 is none.
class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int fd) : fd_(fd) {}
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~FileDescriptor();

  [[nodiscard]] int get() const { return fd_; }

 private:
  int fd_ = -1;
};

/// Whether this errno says that there is no room: disk full, quota used up, file larger than allowed.
[[nodiscard]] bool means_no_space(int error_number);

/// The error for a system call that failed with `error_number` (errno). `action` completes "cannot ... PATH": "write".
/// No room: no_space. No such file or folder: not_found. Not permitted: unavailable. `where` is the path.
[[nodiscard]] Error file_error(int error_number, const std::string& action, const std::filesystem::path& path);

}  // namespace engine
