#include "server/scenes/disk/public_errors.h"

#include <array>
#include <string>
#include <string_view>

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

tl::unexpected<engine::Error> PublicErrors::operator()(engine::Error error, const std::filesystem::path& within) const {
  error = without_folder(std::move(error), within);
  for (const std::filesystem::path& folder : folders_) error = without_folder(std::move(error), folder);
  constexpr std::array<std::pair<std::string_view, std::string_view>, 2> limits{
      std::pair{"(max_gaussians)", "(--max-gaussians)"}, {"(max_memory_bytes)", "(--scene-memory)"}};
  for (const auto& [engines, ours] : limits)
    if (const auto at = error.message.find(engines); at != std::string::npos)
      error.message.replace(at, engines.size(), ours);
  return tl::make_unexpected(std::move(error));
}

}  // namespace server::scenes
