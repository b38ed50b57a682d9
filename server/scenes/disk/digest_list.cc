#include "server/scenes/disk/digest_list.h"

#include <algorithm>
#include <cstdint>
#include <string_view>
#include <system_error>
#include <utility>

#include "engine/core/file_descriptor.h"
#include "engine/io/read_bytes.h"
#include "server/scenes/disk/digest.h"

namespace server::scenes {
namespace {

namespace fs = std::filesystem;
using engine::ErrorCode;
using engine::propagate;

constexpr std::string_view begin = "XXH3 (", middle = ") = ";
constexpr std::uint64_t max_list_bytes = std::uint64_t{64} << 20;  // a million paths come to less. A choice.

}  // namespace

Result<DigestList> digests_below(const fs::path& folder) {
  DigestList list;
  std::error_code error;
  for (auto entry = fs::recursive_directory_iterator(folder, error); !error && entry != fs::end(entry);
       entry.increment(error)) {
    std::error_code unreadable;
    if (!fs::is_regular_file(entry->symlink_status(unreadable))) continue;
    auto digest = digest_of_file(entry->path());
    if (!digest) return propagate(digest);
    list[entry->path().lexically_relative(folder).generic_string()] = std::move(*digest);
  }
  if (error) return tl::make_unexpected(engine::file_error(error.value(), "read", folder));
  return list;
}

std::string to_text(const DigestList& list) {
  std::string text;
  for (const auto& [path, digest] : list) text.append(begin).append(path).append(middle).append(digest).append("\n");
  return text;
}

Result<DigestList> read_digest_list(const fs::path& file, const std::string& digest, const std::string& where) {
  if (auto sound = check_digest(file, digest, where); !sound) return propagate(sound);
  const auto bytes = engine::io::read_bytes(file, max_list_bytes);
  if (!bytes) return propagate(bytes);
  std::string_view text(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  DigestList list;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    const std::size_t at = line.rfind(middle);
    if (!line.starts_with(begin) || at == std::string_view::npos || !is_digest(line.substr(at + middle.size())))
      return engine::fail(ErrorCode::corrupt_data, "the file is no list of checksums", where);
    list[std::string(line.substr(begin.size(), at - begin.size()))] = line.substr(at + middle.size());
  }
  return list;
}

}  // namespace server::scenes
