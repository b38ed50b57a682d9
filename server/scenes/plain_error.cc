#include "server/scenes/plain_error.h"

#include <string>

namespace server::scenes {

engine::Error without_folder(engine::Error error, const std::filesystem::path& folder) {
  const std::string path = folder.string(), name = folder.filename().string();
  if (name.empty()) return error;  // nothing, or the root of all
  for (std::string* const text : {&error.message, &error.where})
    for (std::size_t at = text->find(path); at != std::string::npos; at = text->find(path, at)) {
      const bool above = text->compare(at + path.size(), 1, "/") == 0;
      text->replace(at, path.size() + (above ? 1 : 0), above ? "" : name);
      at += above ? 0 : name.size();
    }
  return error;
}

}  // namespace server::scenes
