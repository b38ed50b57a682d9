// The text at the start of a .ply file: which elements follow, and where their bytes lie.
// Source: Turk 1994, "The PLY polygon file format".
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/input_file.h"

namespace engine::io {

/// The types of a property.
enum class PlyType : std::uint8_t { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

[[nodiscard]] std::size_t size_of(PlyType type) noexcept;

/// A property of an element.
struct PlyProperty {
  std::string name;
  PlyType type = PlyType::float32;
  std::size_t offset = 0;  ///< Bytes from the start of the row.
  bool is_list = false;    ///< Then the row has no fixed length, and offset and stride mean nothing.
};

/// An element: a table of `count` rows with its properties.
struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
  std::size_t stride = 0;       ///< Bytes per row.
  std::size_t count_begin = 0;  ///< Where in the header's text the digits of `count` are,
  std::size_t count_size = 0;   ///< and how many.

  [[nodiscard]] const PlyProperty* find(std::string_view property) const;
  [[nodiscard]] bool has_list() const;
};

/// The encodings of a .ply file.
enum class PlyFormat { ascii, binary_little_endian, binary_big_endian };

/// The header of a .ply file.
struct PlyHeader {
  std::string text;  ///< As in the file: comments, spacing and line endings (LF or CRLF) included, to the last byte.
  PlyFormat format = PlyFormat::ascii;
  std::vector<PlyElement> elements;  ///< In file order.

  [[nodiscard]] const PlyElement* find(std::string_view element) const;
};

constexpr std::size_t max_ply_header_bytes = std::size_t(1) << 20;

/// Does a file that begins with these bytes claim to be a .ply file?
[[nodiscard]] bool starts_like_ply(std::string_view bytes);

/// Parses the header at the start of `bytes`, of which at most max_ply_header_bytes are looked at.
///   file    base name of the file, for `where`
///   errors  corrupt_data (`where` is "<file>:header", the message names the line), too_large: no end_header in reach
[[nodiscard]] Result<PlyHeader> parse_ply_header(std::string_view bytes, const std::string& file);
[[nodiscard]] Result<PlyHeader> read_ply_header(const InputFile& file);

/// Where each element begins, as bytes from the start of the file; one more entry for the end of the last.
/// Refuses what this room cannot walk: ASCII and big-endian files, lists; and a file longer or shorter than its header
/// says. No count of the header is believed before this.
///   errors  unsupported, corrupt_data
[[nodiscard]] Result<std::vector<std::uint64_t>> element_offsets(const PlyHeader& header, const InputFile& file);

}  // namespace engine::io
