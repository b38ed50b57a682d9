#include "engine/io/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string>

namespace engine::io {
namespace {

std::filesystem::path folder_of(const std::filesystem::path& path) {
  return path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
}

tl::unexpected<Error> failed(const std::string& action, const std::filesystem::path& path) {
  return tl::make_unexpected(file_error(errno, action, path));
}

}  // namespace

AtomicFile::AtomicFile(FileDescriptor fd, std::filesystem::path path, std::filesystem::path temporary)
    : fd_(std::move(fd)), path_(std::move(path)), temporary_(std::move(temporary)) {}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : fd_(std::move(other.fd_)), path_(std::move(other.path_)), temporary_(std::move(other.temporary_)) {
  other.temporary_.clear();
}

AtomicFile::~AtomicFile() {
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

Result<AtomicFile> AtomicFile::create(const std::filesystem::path& path) {
  // Asked before the work rather than after it, when rename() would refuse.
  std::error_code ignored;
  if (!path.has_filename() || std::filesystem::is_directory(path, ignored))
    return tl::make_unexpected(file_error(EISDIR, "write", path));
  const std::string prefix = ".splatdrag-" + std::to_string(::getpid()) + "-";
  for (int n = 0;; ++n) {
    const auto temporary = folder_of(path) / (prefix + std::to_string(n) + ".tmp");
    FileDescriptor fd(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));  // umask applies
    if (fd.get() >= 0) return AtomicFile(std::move(fd), path, temporary);
    if (errno != EEXIST) return failed("write", path);
  }
}

Result<void> AtomicFile::write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const auto written = ::write(fd_.get(), bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return failed("write", path_);
    bytes = bytes.subspan(std::size_t(written));
  }
  return {};
}

Result<void> AtomicFile::commit() {
  if (::fsync(fd_.get()) != 0) return failed("write", path_);
  if (::rename(temporary_.c_str(), path_.c_str()) != 0) return failed("write", path_);
  temporary_.clear();
  const auto folder = folder_of(path_);
  const FileDescriptor folder_fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder_fd.get() < 0 || ::fsync(folder_fd.get()) != 0) return failed("sync", folder);
  return {};
}

Result<void> write_file(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  auto file = AtomicFile::create(path);
  if (!file) return propagate(file);
  if (auto written = file->write(bytes); !written) return written;
  return file->commit();
}

}  // namespace engine::io
