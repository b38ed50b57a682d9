#include "server/scenes/disk/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>

#include <cerrno>
#include <thread>

namespace server::scenes {
namespace {

using engine::Result;

constexpr const char* lock_name = ".lock";
constexpr std::chrono::milliseconds between_tries{20};

/// Whether the lock could be had.
bool locked(const engine::FileDescriptor& opened, int kind) { return ::flock(opened.get(), kind | LOCK_NB) == 0; }
/// The same of a folder; a file system that locks none (NFS) counts as one that let us have it.
bool locked_folder(const engine::FileDescriptor& opened, int kind) {
  return locked(opened, kind) || errno != EWOULDBLOCK;
}

}  // namespace

Result<FolderLock> FolderLock::take(const std::filesystem::path& folder, Sharing sharing,
                                    std::chrono::milliseconds patience) {
  FolderLock lock;
  lock.folder_ = engine::FileDescriptor(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (lock.folder_.get() < 0) return tl::make_unexpected(engine::file_error(errno, "open", folder));
  lock.file_ = engine::FileDescriptor(::open((folder / lock_name).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
  if (lock.file_.get() < 0) return tl::make_unexpected(engine::file_error(errno, "open", folder / lock_name));
  const auto has_both = [&](int kind) { return locked_folder(lock.folder_, kind) && locked(lock.file_, kind); };
  lock.is_alone_ = has_both(LOCK_EX);
  if (lock.is_alone_) return lock;
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (sharing == Sharing::shared) {
    if (has_both(LOCK_SH)) return lock;
    if (std::chrono::steady_clock::now() >= deadline) break;
    std::this_thread::sleep_for(between_tries);
  }
  return engine::fail(engine::ErrorCode::conflict,
                      "another service uses this data folder: stop it, or choose another folder", folder.string());
}

void FolderLock::share() {
  // One lock is let go of before the other is there, and another that begins may come in between: it is waited for.
  (void)::flock(folder_.get(), LOCK_SH);
  (void)::flock(file_.get(), LOCK_SH);
  is_alone_ = false;
}

}  // namespace server::scenes
