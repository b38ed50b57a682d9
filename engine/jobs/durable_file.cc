#include "engine/jobs/durable_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <span>
#include <system_error>

#include "engine/core/atomic_file.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;

Error trouble(int error_number, const std::string& action, const fs::path& path) {
  const std::string what = "cannot " + action + " " + path.filename().string(),
                    reason = std::generic_category().message(error_number);
  if (means_no_space(error_number))
    return {ErrorCode::no_space, what + " (" + reason + "): free some space and try again", path};
  return {ErrorCode::unavailable, what + ": " + reason, path};
}

}  // namespace

Result<void> create_folder(const fs::path& folder) {
  std::error_code error;
  if (fs::is_directory(folder, error)) return {};
  if (folder.has_parent_path() && folder.parent_path() != folder)
    if (auto made = create_folder(folder.parent_path()); !made) return made;
  fs::create_directory(folder, error);
  if (error) return tl::make_unexpected(trouble(error.value(), "make the folder", folder));
  return sync_folder(folder.parent_path(), trouble);
}

Result<void> write_durably(const fs::path& file, std::string_view bytes) {
  return write_file(file, std::as_bytes(std::span(bytes)), trouble);
}

Result<std::string> read_bytes(const fs::path& file) {
  const FileDescriptor in(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  if (in.get() < 0 && errno == ENOENT) return fail(ErrorCode::not_found, "the file cannot be opened", file);
  if (in.get() < 0) return tl::make_unexpected(trouble(errno, "open", file));
  std::string bytes;
  for (std::array<char, 65536> block{};;) {
    const ssize_t got = ::read(in.get(), block.data(), block.size());
    if (got == 0) return bytes;
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return tl::make_unexpected(trouble(errno, "read", file));
    bytes.append(block.data(), std::size_t(got));
  }
}

}  // namespace engine::jobs
