// Bytes as text and back: base64.
// Source: RFC 4648, section 4.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace proto {

/// With padding, without line breaks.
[[nodiscard]] std::string to_base64(std::string_view bytes);

/// The reverse, strictly: nothing for a text that to_base64() does not write.
[[nodiscard]] std::optional<std::string> from_base64(std::string_view text);

}  // namespace proto
