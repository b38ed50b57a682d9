// JSON text to a document, with nothing taken on trust: size, depth, repeated names, numbers that overflow.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "proto/wire.h"

namespace proto {

/// Parses a text.
///   errors  as parse_edit_request(); `where` of a number that overflows or a repeated name is its address
[[nodiscard]] Result<nlohmann::json> parse_document(std::string_view text, const JsonLimits& limits);

/// Text from a document as it may stand in a message or an address: one line, ASCII, not long.
[[nodiscard]] std::string printable(std::string_view text);

}  // namespace proto
