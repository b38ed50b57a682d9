#include "server/edits/temporary_folder.h"

#include <stdlib.h>

#include <cerrno>
#include <system_error>

#include "engine/core/file_descriptor.h"

namespace server::edits {

namespace fs = std::filesystem;

engine::Result<TemporaryFolder> TemporaryFolder::make(const std::string& name) {
  std::error_code error;
  std::string path = (fs::temp_directory_path(error) / (name + "-XXXXXX")).string();
  if (::mkdtemp(path.data()) == nullptr) return tl::make_unexpected(engine::file_error(errno, "make", path));
  return TemporaryFolder(path);
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
}

}  // namespace server::edits
