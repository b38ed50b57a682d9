#include "server/scenes/catalogue/names.h"

#include <algorithm>
#include <filesystem>
#include <random>
#include <string_view>

namespace server::scenes {
namespace {

constexpr std::size_t max_name_bytes = 200;  // of a scene's or file's name: file systems take 255. A choice.

bool is_control(unsigned char c) { return c < 0x20 || c == 0x7f; }

}  // namespace

std::string safe_file_name(const std::string& filename) {
  std::string name = filename.substr(filename.find_last_of("/\\") + 1);  // npos + 1 is 0
  std::replace_if(name.begin(), name.end(), is_control, '_');
  if (name.size() > max_name_bytes) {
    name = name.substr(name.size() - max_name_bytes);
    while ((static_cast<unsigned char>(name.front()) & 0xc0) == 0x80) name.erase(0, 1);  // the rest of a cut character
  }
  const bool usable = name.find_first_not_of('.') != std::string::npos;
  return usable ? name : "upload";
}

Result<std::string> checked_name(const std::string& name) {
  if (name.empty() || name.size() > max_name_bytes || std::any_of(name.begin(), name.end(), is_control))
    return engine::fail(
        engine::ErrorCode::invalid_argument,
        "expected a name of 1 to " + std::to_string(max_name_bytes) + " bytes without control characters", "name");
  return name;
}

Result<std::string> name_for(const std::string& given_name, const std::string& file_name) {
  if (!given_name.empty()) return checked_name(given_name);
  const std::string stem = std::filesystem::path(file_name).stem().string();
  return stem.empty() ? "scene" : stem;
}

std::uint64_t random_number() {
  std::random_device device;
  return std::uint64_t(device()) << 32 | device();
}

std::string random_nonce() {
  std::random_device device;
  constexpr std::string_view digits = "0123456789abcdef";
  std::string nonce;
  for (int i = 0; i < 16; ++i) nonce += digits[device() % digits.size()];
  return nonce;
}

}  // namespace server::scenes
