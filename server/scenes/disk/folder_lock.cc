#include "server/scenes/disk/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>

#include <cerrno>

namespace server::scenes {
namespace {

using engine::Result;

constexpr const char* lock_name = ".lock";

/// Whether the lock could be had; a file system that locks no folders (NFS) counts as one that let us have it.
bool locked(const engine::FileDescriptor& opened) {
  return ::flock(opened.get(), LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK;
}

}  // namespace

Result<FolderLock> FolderLock::take(const std::filesystem::path& folder) {
  FolderLock lock;
  lock.folder_ = engine::FileDescriptor(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (lock.folder_.get() < 0) return tl::make_unexpected(engine::file_error(errno, "open", folder));
  lock.file_ = engine::FileDescriptor(::open((folder / lock_name).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
  if (lock.file_.get() < 0) return tl::make_unexpected(engine::file_error(errno, "open", folder / lock_name));
  if (!locked(lock.folder_) || ::flock(lock.file_.get(), LOCK_EX | LOCK_NB) != 0)
    return engine::fail(engine::ErrorCode::conflict,
                        "another service uses this data folder: stop it, or choose another folder", folder.string());
  return lock;
}

}  // namespace server::scenes
