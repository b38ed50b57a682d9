#include "server/scenes/uploads/scene_root.h"

#include <algorithm>
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
