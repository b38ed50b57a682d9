#include "engine/jobs/durable_file.h"

#include <fstream>
#include <iterator>
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
  std::ifstream in(file, std::ios::binary);
  if (!in) return fail(ErrorCode::not_found, "the file cannot be opened", file);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  if (in.bad()) return fail(ErrorCode::unavailable, "the file cannot be read to its end", file);
  return bytes;
}

}  // namespace engine::jobs
