// Header values that choose what is sent: Accept, If-None-Match, Range, Content-Type, multipart boundaries.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace server::http {

/// Whether an Accept header takes a media type: the most specific element that matches decides, q=0 refuses. An empty
/// header takes everything.
[[nodiscard]] bool accepts(std::string_view accept, std::string_view media_type);

/// Whether an If-None-Match header names this entity tag (given without quotes), by weak comparison; "*" names any.
[[nodiscard]] bool names_etag(std::string_view if_none_match, std::string_view etag);

/// An entity tag for these bytes.
[[nodiscard]] std::string etag_of(std::string_view bytes);

/// Positions of the first and the last byte of a part.
struct ByteRange {
  std::uint64_t first = 0, last = 0;  ///< Both included.
};
enum class RangeKind {
  whole,         ///< No range that we know: several, another unit, or malformed. Send everything.
  part,          ///< Send the bytes of the range.
  unsatisfiable  ///< The range begins beyond the end.
};
/// What to send. `range` has a meaning for RangeKind::part only.
struct RangeChoice {
  RangeKind kind = RangeKind::whole;
  ByteRange range;
};
/// What a Range header asks of `size` bytes.
[[nodiscard]] RangeChoice choose_range(std::string_view range, std::uint64_t size);

/// The media type of a Content-Type header: lower case, without parameters.
[[nodiscard]] std::string media_type_of(std::string_view content_type);
/// The boundary of a multipart Content-Type; nothing if there is none, or it is not one (RFC 2046, section 5.1.1).
[[nodiscard]] std::optional<std::string> boundary_of(std::string_view content_type);

/// The media type of a file, by its name's ending.
[[nodiscard]] std::string_view media_type_of_file(std::string_view name);

/// A name for a file as a client gave it: without folders and control characters, UTF-8, at most 255 bytes.
[[nodiscard]] std::string base_name(std::string_view filename);

}  // namespace server::http
