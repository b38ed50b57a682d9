#include "server/cli/folders.h"

#include <string>
#include <system_error>

#include "engine/core/file_descriptor.h"

namespace server::cli {

using engine::ErrorCode;
using engine::fail;

engine::Result<void> make_folder(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  std::error_code unreachable;
  if (std::filesystem::is_directory(path, unreachable)) return {};
  if (!error || error == std::errc::not_a_directory || error == std::errc::file_exists)
    return fail(ErrorCode::invalid_argument, "the results need a folder, but there is a file in its place",
                path.string());
  if (engine::means_no_space(error.value()))
    return fail(ErrorCode::no_space, "the disk has no room for a new folder", path.string());
  return fail(ErrorCode::unavailable, "cannot make the folder: " + error.message(), path.string());
}

engine::Result<void> keep_input_safe(const std::filesystem::path& input, const std::filesystem::path& output) {
  std::error_code absent;
  if (!std::filesystem::equivalent(input, output, absent)) return {};
  return fail(ErrorCode::conflict, "the result would replace what it is made from; choose another --out",
              output.string());
}

}  // namespace server::cli
