#include "engine/core/atomic_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <system_error>
#include <utility>

namespace engine {

AtomicFile::AtomicFile(FileDescriptor fd, std::filesystem::path path, std::filesystem::path temporary,
                       FileErrorOf error_of)
    : fd_(std::move(fd)), path_(std::move(path)), temporary_(std::move(temporary)), error_of_(error_of) {}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : fd_(std::move(other.fd_)),
      path_(std::move(other.path_)),
      temporary_(std::move(other.temporary_)),
      error_of_(other.error_of_) {
  other.temporary_.clear();
}

AtomicFile::~AtomicFile() {
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

tl::unexpected<Error> AtomicFile::failed() const { return tl::make_unexpected(error_of_(errno, "write", path_)); }

Result<AtomicFile> AtomicFile::create(const std::filesystem::path& path, FileErrorOf error_of) {
  // Asked before the work rather than after it, when rename() would refuse.
  std::error_code ignored;
  if (!path.has_filename() || std::filesystem::is_directory(path, ignored))
    return tl::make_unexpected(error_of(EISDIR, "write", path));
  const std::string prefix = temporary_prefix + std::to_string(::getpid()) + "-";
  for (int n = 0;; ++n) {
    auto temporary = path.parent_path() / (prefix + std::to_string(n) + ".tmp");
    FileDescriptor fd(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));  // umask applies
    if (fd.get() >= 0) return AtomicFile(std::move(fd), path, std::move(temporary), error_of);
    if (errno != EEXIST) return tl::make_unexpected(error_of(errno, "write", path));
  }
}

Result<void> AtomicFile::write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const auto written = ::write(fd_.get(), bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return failed();
    bytes = bytes.subspan(std::size_t(written));
  }
  return {};
}

Result<void> AtomicFile::commit() {
  if (::fsync(fd_.get()) != 0) return failed();
  if (::rename(temporary_.c_str(), path_.c_str()) != 0) return failed();
  temporary_.clear();
  return sync_folder(path_.parent_path(), error_of_);
}

Result<void> write_file(const std::filesystem::path& path, std::span<const std::byte> bytes, FileErrorOf error_of) {
  auto file = AtomicFile::create(path, error_of);
  if (!file) return propagate(file);
  if (auto written = file->write(bytes); !written) return written;
  return file->commit();
}

Result<void> sync_folder(const std::filesystem::path& folder, FileErrorOf error_of) {
  const std::filesystem::path named = folder.empty() ? std::filesystem::path(".") : folder;
  const FileDescriptor opened(::open(named.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (opened.get() < 0 || ::fsync(opened.get()) != 0) return tl::make_unexpected(error_of(errno, "sync", named));
  return {};
}

}  // namespace engine
