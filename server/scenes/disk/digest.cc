#include "server/scenes/disk/digest.h"

#include <sys/stat.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "engine/io/input_file.h"

namespace server::scenes {
namespace {

namespace fs = std::filesystem;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;

constexpr std::size_t piece_bytes = std::size_t{256} << 10;  // stays in the processor's second cache
constexpr std::size_t digits = 16;

std::string in_hexadecimal(std::uint64_t number) {
  std::string text(digits, '0');
  for (std::size_t i = digits; i-- > 0; number >>= 4) text[i] = "0123456789abcdef"[number & 15];
  return text;
}

struct FreeState {
  void operator()(XXH3_state_t* state) const { XXH3_freeState(state); }
};

}  // namespace

std::string digest_of(std::span<const std::byte> bytes) {
  return in_hexadecimal(XXH3_64bits(bytes.data(), bytes.size()));
}

Result<std::string> digest_of_file(const fs::path& path) {
  const auto file = engine::io::InputFile::open(path);
  if (!file) return propagate(file);
  const std::unique_ptr<XXH3_state_t, FreeState> state(XXH3_createState());
  if (!state || XXH3_64bits_reset(state.get()) == XXH_ERROR)
    return fail(ErrorCode::too_large, "this machine has not enough memory for that", file->name());
  std::vector<std::byte> piece(std::size_t(std::min<std::uint64_t>(piece_bytes, file->size())));
  for (std::uint64_t at = 0; at < file->size(); at += piece.size()) {
    const auto part = std::span(piece).first(std::size_t(std::min<std::uint64_t>(piece.size(), file->size() - at)));
    if (auto read = file->read_at(at, part); !read) return propagate(read);
    (void)XXH3_64bits_update(state.get(), part.data(), part.size());  // fails only for a null pointer
  }
  return in_hexadecimal(XXH3_64bits_digest(state.get()));
}

bool is_digest(std::string_view text) {
  return text.size() == digits && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

Result<void> check_digest(const fs::path& file, const std::string& digest, const std::string& where) {
  if (digest.empty()) return {};
  const auto found = digest_of_file(file);
  if (!found && found.error().code == ErrorCode::not_found)
    return fail(ErrorCode::corrupt_data, "the stored file is gone: put back a copy of it", where);
  if (!found) return fail(found.error().code, "the stored file cannot be read", where);  // that error has its path
  if (*found == digest) return {};
  return fail(ErrorCode::corrupt_data,
              "the stored file is damaged: its checksum is not the one noted when it was stored; put back a copy of it",
              where);
}

SoundFiles::Stamp SoundFiles::stamp_of(const fs::path& file) {
  struct stat about {};
  if (::stat(file.c_str(), &about) != 0) return {};
  return {about.st_ino,          std::uint64_t(about.st_size), about.st_mtim.tv_sec,
          about.st_mtim.tv_nsec, about.st_ctim.tv_sec,         about.st_ctim.tv_nsec};
}

Result<void> SoundFiles::check(const fs::path& file, const std::string& digest, const std::string& where) {
  if (digest.empty()) return {};
  const auto now = std::chrono::steady_clock::now();
  const Stamp stamp = stamp_of(file);  // before it is read: a change from now on makes it another
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(found_, [&](const auto& known) { return known.second.until <= now; });
    const auto known = found_.find(file);
    if (known != found_.end() && known->second.stamp == stamp && known->second.digest == digest) return {};
  }
  if (auto sound = check_digest(file, digest, where); !sound) return sound;
  // A change within one tick of the file system's clock would not show in the times.
  const auto settled = std::chrono::system_clock::now() - std::chrono::seconds(2);
  if (std::get<4>(stamp) >= std::chrono::system_clock::to_time_t(settled)) return {};
  const std::lock_guard lock(mutex_);
  found_[file] = {stamp, digest, now + trust_};
  return {};
}

}  // namespace server::scenes
