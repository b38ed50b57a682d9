#include "engine/core/file_lock.h"

#include <fcntl.h>

#include <cerrno>
#include <thread>

namespace engine {
namespace {

constexpr std::chrono::milliseconds between_tries{2};

/// 0, or the number of an error.
int try_to_lock(const FileDescriptor& opened, std::uint64_t number, LockKind kind) {
  struct flock range {};
  range.l_type = short(kind == LockKind::alone ? F_WRLCK : F_RDLCK);
  range.l_whence = SEEK_SET;
  range.l_start = off_t(number);
  range.l_len = 1;
  return ::fcntl(opened.get(), F_OFD_SETLK, &range) == 0 ? 0 : errno;
}

}  // namespace

Result<FileLock> FileLock::take(const std::filesystem::path& file, std::uint64_t number, LockKind kind,
                                std::chrono::milliseconds patience) {
  FileDescriptor opened(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
  if (opened.get() < 0) return tl::make_unexpected(file_error(errno, "open", file));
  const auto deadline = std::chrono::steady_clock::now() + patience;
  for (int failed = 0; (failed = try_to_lock(opened, number, kind)) != 0;) {
    if (failed != EAGAIN && failed != EACCES && failed != EINTR)
      return tl::make_unexpected(file_error(failed, "lock", file));
    if (std::chrono::steady_clock::now() >= deadline)
      return fail(ErrorCode::busy, "others are at work on it just now: try again", file);
    std::this_thread::sleep_for(between_tries);
  }
  return FileLock(std::move(opened));
}

}  // namespace engine
