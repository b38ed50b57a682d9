// gzip, in steps that the reader of an untrusted file can stop.
#pragma once

#include <zlib.h>

#include <cstddef>
#include <span>
#include <vector>

namespace engine::io {

/// Unpacks one gzip stream piece by piece, never more than is asked for.
class GzipReader {
 public:
  explicit GzipReader(std::span<const std::byte> bytes);
  ~GzipReader();
  GzipReader(const GzipReader&) = delete;
  GzipReader& operator=(const GzipReader&) = delete;

  /// Fills `into`; false if the stream is damaged or ends first.
  [[nodiscard]] bool read(std::span<std::byte> into);
  /// Fills as much of `into` as the stream has left, and says how much that is.
  [[nodiscard]] std::size_t read_some(std::span<std::byte> into);
  /// True if the stream ends here, its checksum is right and no byte follows it.
  [[nodiscard]] bool at_end();

 private:
  std::span<const std::byte> bytes_;  ///< Not yet handed to zlib.
  z_stream stream_{};
  bool ok_ = false, ended_ = false;
};

/// One gzip stream, the same bytes every time (no name, no date). Throws std::bad_alloc.
[[nodiscard]] std::vector<std::byte> gzip(std::span<const std::byte> bytes);

}  // namespace engine::io
