#include "server/scenes/uploads/scene_root.h"

#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

namespace server::scenes {
namespace {

namespace fs = std::filesystem;
using engine::ErrorCode;
using engine::fail;

bool begins_with(const fs::path& path, const fs::path& root) {
  return std::mismatch(root.begin(), root.end(), path.begin(), path.end()).first == root.end();
}

tl::unexpected<engine::Error> leads_out() {
  return fail(ErrorCode::invalid_argument, "the path leads out of the scene root: give one below it, without \"..\"",
              "path");
}

}  // namespace

bool lies_below(const fs::path& root, const fs::path& path) {
  std::error_code error;
  const fs::path real_root = fs::canonical(root, error);
  if (error) return false;
  const fs::path real = fs::canonical(path, error);
  return !error && begins_with(real, real_root);
}

Result<fs::path> below_root(const fs::path& root, const std::string& path) {
  if (root.empty())
    return fail(ErrorCode::invalid_argument,
                "this service opens no files by path: start it with --scene-root, or upload the file", "path");
  if (path.empty() || path.find('\0') != std::string::npos)
    return fail(ErrorCode::invalid_argument, "expected the path of a file below the scene root", "path");
  const fs::path given(path);
  if (std::find(given.begin(), given.end(), "..") != given.end()) return leads_out();
  std::error_code error;
  const fs::path real_root = fs::canonical(root, error);
  if (error) return fail(ErrorCode::unavailable, "the scene root cannot be opened: " + error.message(), "path");
  // What lies outside is refused before it is looked for: the answer must not tell what exists there.
  if (given.is_absolute() && !begins_with(given.lexically_normal(), real_root) &&
      !begins_with(given.lexically_normal(), fs::absolute(root, error).lexically_normal()))
    return leads_out();
  const fs::path real = fs::canonical(real_root / given, error);
  if (error) return fail(ErrorCode::not_found, "there is no " + path + " below the scene root", "path");
  if (!begins_with(real, real_root)) return leads_out();
  return real;
}

Result<engine::FileDescriptor> open_below_root(const fs::path& root, const std::string& path) {
  const auto found = below_root(root, path);
  if (!found) return engine::propagate(found);
  std::error_code error;
  const fs::path real_root = fs::canonical(root, error);
  const engine::FileDescriptor base(::open(real_root.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
  open_how how{};
  how.flags = O_RDONLY | O_CLOEXEC | O_NONBLOCK;                                // a pipe must not make us wait
  how.resolve = RESOLVE_BENEATH | RESOLVE_NO_SYMLINKS | RESOLVE_NO_MAGICLINKS;  // below_root() has left no links
  const fs::path relative = found->lexically_relative(real_root);
  engine::FileDescriptor file(int(::syscall(SYS_openat2, base.get(), relative.c_str(), &how, sizeof how)));
  const bool is_unknown = file.get() < 0 && (errno == ENOSYS || errno == EPERM);  // before Linux 5.6, or forbidden
  if (is_unknown) file = engine::FileDescriptor(::open(found->c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW));
  if (file.get() < 0 && errno == ENOENT)
    return fail(ErrorCode::not_found, "there is no " + path + " below the scene root", "path");
  if (file.get() < 0 && (errno == EXDEV || errno == ELOOP)) return leads_out();
  struct stat about {};
  if (file.get() < 0 || ::fstat(file.get(), &about) != 0)
    return fail(ErrorCode::unavailable, "the file cannot be read: " + std::generic_category().message(errno), "path");
  if (!S_ISREG(about.st_mode))
    return fail(ErrorCode::invalid_argument, "expected a file, not a folder or a pipe", "path");
  // Where it is open, says the system itself.
  if (is_unknown && !lies_below(root, "/proc/self/fd/" + std::to_string(file.get()))) return leads_out();
  return file;
}

Result<void> check_links(const fs::path& root, const fs::path& folder, std::size_t max_files) {
  std::error_code error;
  std::size_t files = 0;
  for (auto entry = fs::recursive_directory_iterator(folder, error); !error && entry != fs::end(entry);
       entry.increment(error)) {
    if (++files > max_files)
      return fail(ErrorCode::too_large,
                  "the folder has more than " + std::to_string(max_files) +
                      " entries, the limit of a dataset (--max-dataset-files)",
                  "path");
    std::error_code unreadable;
    if (fs::is_symlink(entry->symlink_status(unreadable)) && !lies_below(root, entry->path()))
      return fail(ErrorCode::invalid_argument,
                  "the link " + entry->path().lexically_relative(folder).string() + " leads out of the scene root",
                  "path");
  }
  return {};
}

}  // namespace server::scenes
