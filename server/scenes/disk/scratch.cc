#include "server/scenes/disk/scratch.h"

#include <string>

#include "server/scenes/disk/disk.h"

namespace server::scenes {

Scratch::~Scratch() {
  if (!folder_.empty()) remove_quietly(folder_);
}

Result<void> ScratchFolders::open(bool is_alone) {
  if (is_alone) remove_quietly(folder_);
  return make_folder(folder_);
}

Result<Scratch> ScratchFolders::make() {
  const std::filesystem::path folder = folder_ / (prefix_ + std::to_string(++last_));
  if (auto status = make_folder(folder); !status) return public_error_(status, folder);
  return Scratch(folder);
}

}  // namespace server::scenes
