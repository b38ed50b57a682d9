#include "server/pictures/picture_names.h"

#include <algorithm>
#include <set>

namespace server::pictures {
namespace {

std::string flattened(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return c == '/' || c == '\\' || c < 0x20; }, '_');
  return name;
}

std::string without_extension(const std::string& name) {
  const std::size_t dot = name.rfind('.');
  return dot == std::string::npos || dot == 0 ? name : name.substr(0, dot);
}

}  // namespace

std::vector<std::string> picture_names(const std::vector<engine::scene::Camera>& views) {
  std::vector<std::string> names;
  std::set<std::string> taken;
  for (const auto& view : views) {
    const std::string full = flattened(view.name.empty() ? "view" : view.name);
    std::string name = without_extension(full);
    if (taken.contains(name)) name = full;
    for (int number = 2; taken.contains(name); ++number) name = full + "_" + std::to_string(number);
    taken.insert(name);
    names.push_back(name);
  }
  return names;
}

}  // namespace server::pictures
