// Source: PKWARE, "APPNOTE.TXT - .ZIP File Format Specification", sections 4.3.14 to 4.3.16.
#include "engine/io/zip_directory.h"

#include <algorithm>
#include <cstddef>
#include <span>
#include <string_view>

#include "engine/io/input_file.h"

namespace engine::io {
namespace {

using Bytes = std::span<const std::byte>;

constexpr std::string_view end_mark = "PK\x05\x06", locator_mark = "PK\x06\x07", large_end_mark = "PK\x06\x06";
constexpr std::size_t end_bytes = 22, locator_bytes = 20, large_end_bytes = 56, max_comment_bytes = 65535;

std::uint64_t number_at(Bytes bytes, std::size_t offset, std::size_t size) {
  std::uint64_t number = 0;
  for (std::size_t i = size; i-- > 0;) number = number << 8 | std::to_integer<std::uint64_t>(bytes[offset + i]);
  return number;
}

bool begins_with(Bytes bytes, std::string_view mark) {
  return bytes.size() >= mark.size() && std::ranges::equal(bytes.first(mark.size()), std::as_bytes(std::span(mark)));
}

void raise(ZipDirectory& most, std::uint64_t entries, std::uint64_t bytes) {
  most.entries = std::max(most.entries, entries);
  most.bytes = std::max(most.bytes, bytes);
}

/// read(offset, size) gives that many bytes of a file of `file_bytes`.
template <class Read>
Result<ZipDirectory> find_directory(std::uint64_t file_bytes, Read&& read_at) {
  const std::uint64_t reach = std::min<std::uint64_t>(file_bytes, locator_bytes + end_bytes + max_comment_bytes);
  const auto read = read_at(file_bytes - reach, reach);
  if (!read) return propagate(read);
  const Bytes tail(*read);
  ZipDirectory most;
  for (std::size_t at = 0; at + end_bytes <= tail.size(); ++at) {
    if (!begins_with(tail.subspan(at), end_mark)) continue;
    raise(most, number_at(tail, at + 10, 2), number_at(tail, at + 12, 4));
    if (at < locator_bytes || !begins_with(tail.subspan(at - locator_bytes), locator_mark)) continue;
    const std::uint64_t offset = number_at(tail, at - locator_bytes + 8, 8);
    if (file_bytes < large_end_bytes || offset > file_bytes - large_end_bytes) continue;
    const auto large = read_at(offset, large_end_bytes);
    if (!large) return propagate(large);
    if (begins_with(*large, large_end_mark)) raise(most, number_at(*large, 32, 8), number_at(*large, 40, 8));
  }
  return most;
}

}  // namespace

Result<ZipDirectory> largest_directory(const std::filesystem::path& zip) {
  const auto file = InputFile::open(zip);
  if (!file) return propagate(file);
  return find_directory(file->size(),
                        [&](std::uint64_t offset, std::uint64_t size) { return file->read_at(offset, size); });
}

ZipDirectory largest_directory(Bytes zip) {
  return *find_directory(zip.size(), [&](std::uint64_t offset, std::uint64_t size) {
    return Result<Bytes>(zip.subspan(std::size_t(offset), std::size_t(size)));
  });
}

}  // namespace engine::io
