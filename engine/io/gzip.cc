#include "engine/io/gzip.h"

#include <algorithm>
#include <new>

namespace engine::io {
namespace {

constexpr int gzip_window_bits = 15 + 16;           // 16: expect and write gzip's own header
constexpr std::size_t step = std::size_t(1) << 28;  // zlib counts in 32 bits

Bytef* bytef(const std::byte* bytes) { return const_cast<Bytef*>(reinterpret_cast<const Bytef*>(bytes)); }

}  // namespace

GzipReader::GzipReader(std::span<const std::byte> bytes) : bytes_(bytes) {
  ok_ = inflateInit2(&stream_, gzip_window_bits) == Z_OK;
}

GzipReader::~GzipReader() { inflateEnd(&stream_); }

bool GzipReader::read(std::span<std::byte> into) { return read_some(into) == into.size(); }

std::size_t GzipReader::read_some(std::span<std::byte> into) {
  const std::size_t asked = into.size();
  while (ok_ && !ended_ && !into.empty()) {
    if (stream_.avail_in == 0) {
      const auto piece = bytes_.first(std::min(bytes_.size(), step));
      bytes_ = bytes_.subspan(piece.size());
      stream_.next_in = bytef(piece.data());
      stream_.avail_in = uInt(piece.size());
    }
    const std::size_t room = std::min(into.size(), step);
    stream_.next_out = bytef(into.data());
    stream_.avail_out = uInt(room);
    const int status = inflate(&stream_, Z_NO_FLUSH);
    into = into.subspan(room - stream_.avail_out);
    ended_ = status == Z_STREAM_END;
    ok_ = ended_ || status == Z_OK;  // Z_BUF_ERROR: no input left
  }
  return asked - into.size();
}

bool GzipReader::at_end() {
  std::byte surplus;
  if (!ended_ && read({&surplus, 1})) return false;
  return ended_ && stream_.avail_in == 0 && bytes_.empty();
}

std::vector<std::byte> gzip(std::span<const std::byte> bytes) {
  z_stream stream{};
  constexpr int memory_level = 8;
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, gzip_window_bits, memory_level, Z_DEFAULT_STRATEGY) !=
      Z_OK)
    throw std::bad_alloc();
  std::vector<std::byte> packed;
  std::vector<std::byte> buffer(std::size_t(1) << 18);
  int status = Z_OK;
  while (status != Z_STREAM_END) {
    if (stream.avail_in == 0) {
      const auto piece = bytes.first(std::min(bytes.size(), step));
      bytes = bytes.subspan(piece.size());
      stream.next_in = bytef(piece.data());
      stream.avail_in = uInt(piece.size());
    }
    stream.next_out = bytef(buffer.data());
    stream.avail_out = uInt(buffer.size());
    status = deflate(&stream, bytes.empty() ? Z_FINISH : Z_NO_FLUSH);
    packed.insert(packed.end(), buffer.begin(), buffer.end() - std::ptrdiff_t(stream.avail_out));
  }
  deflateEnd(&stream);
  return packed;
}

}  // namespace engine::io
