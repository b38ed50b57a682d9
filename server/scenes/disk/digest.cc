#include "server/scenes/disk/digest.h"

#include <xxhash.h>
#ifdef __x86_64__
#include <xxh_x86dispatch.h>  // the same functions by the widest instructions there are: four times as fast
#endif

#include <algorithm>
#include <array>
#include <new>
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

/// Whether what was found is what was noted.
Result<void> compare(const Result<std::string>& found, const std::string& digest, const std::string& where) {
  if (!found && found.error().code == ErrorCode::not_found)
    return fail(ErrorCode::corrupt_data, "the stored file is gone: put back a copy of it", where);
  if (!found) return fail(found.error().code, "the stored file cannot be read", where);  // that error has its path
  if (*found == digest) return {};
  return fail(ErrorCode::corrupt_data,
              "the stored file is damaged: its checksum is not the one noted when it was stored; put back a copy of it",
              where);
}

}  // namespace

std::string digest_of(std::span<const std::byte> bytes) {
  return in_hexadecimal(XXH3_64bits(bytes.data(), bytes.size()));
}

struct RunningDigest::State {
  XXH3_state_t* const xxh3 = XXH3_createState();
  State() {
    if (xxh3 == nullptr) throw std::bad_alloc();
    (void)XXH3_64bits_reset(xxh3);  // this and the others fail for a null pointer only
  }
  ~State() { (void)XXH3_freeState(xxh3); }
  State(State&&) = delete;
};

RunningDigest::RunningDigest() : state_(std::make_unique<State>()) {}
RunningDigest::~RunningDigest() = default;

void RunningDigest::see(std::uint64_t offset, std::span<const std::byte> bytes) {
  if (offset > seen_ || offset + bytes.size() <= seen_) return;
  const auto fresh = bytes.subspan(std::size_t(seen_ - offset));
  (void)XXH3_64bits_update(state_->xxh3, fresh.data(), fresh.size());
  seen_ += fresh.size();
}

Result<std::string> RunningDigest::finish(const fs::path& path) {
  const auto file = engine::io::InputFile::open(path);
  if (!file) return propagate(file);
  if (seen_ < file->size()) {
    std::vector<std::byte> piece(std::size_t(std::min<std::uint64_t>(piece_bytes, file->size() - seen_)));
    while (seen_ < file->size()) {
      const auto part =
          std::span(piece).first(std::size_t(std::min<std::uint64_t>(piece.size(), file->size() - seen_)));
      if (auto read = file->read_at(seen_, part); !read) return propagate(read);
      see(seen_, part);
    }
  }
  return in_hexadecimal(XXH3_64bits_digest(state_->xxh3));
}

Result<void> RunningDigest::check(const fs::path& file, const std::string& digest, const std::string& where) {
  return digest.empty() ? Result<void>() : compare(finish(file), digest, where);
}

Result<std::string> digest_of_file(const fs::path& path) { return RunningDigest().finish(path); }

bool is_digest(std::string_view text) {
  return text.size() == digits && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

Result<void> check_digest(const fs::path& file, const std::string& digest, const std::string& where) {
  return RunningDigest().check(file, digest, where);
}

Result<void> SoundFiles::check(const fs::path& file, const std::string& digest, const std::string& where) {
  if (digest.empty()) return {};
  const auto now = std::chrono::steady_clock::now();
  const auto stamp = stamp_of(file);  // before it is read: a change from now on makes it another
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(found_, [&](const auto& known) { return known.second.until <= now; });
    const auto known = found_.find(file);
    if (known != found_.end() && stamp && *stamp == known->second.stamp && known->second.digest == digest) return {};
  }
  if (auto sound = check_digest(file, digest, where); !sound) return sound;
  if (!stamp || !is_settled(*stamp)) return {};
  const std::lock_guard lock(mutex_);
  found_[file] = {*stamp, digest, now + trust_};
  return {};
}

}  // namespace server::scenes
