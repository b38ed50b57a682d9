#include "engine/io/read_bytes.h"

#include <string>

#include "engine/io/checks.h"
#include "engine/io/input_file.h"

namespace engine::io {

Result<std::vector<std::byte>> read_bytes(const std::filesystem::path& path, std::uint64_t limit) {
  const auto file = InputFile::open(path);
  if (!file) return propagate(file);
  if (file->size() > limit)
    return fail(ErrorCode::too_large,
                file->name() + " has " + std::to_string(file->size()) + " bytes; the limit is " + std::to_string(limit),
                file->name());
  return within_memory(file->name(), [&] { return file->read_at(0, file->size()); });
}

}  // namespace engine::io
