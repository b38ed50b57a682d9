// The request target: path and query, decoded strictly.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/result.h"

namespace server::http {

/// Undoes %XX escapes.
///   errors  invalid_argument: an incomplete escape, a control character, or bytes that are no UTF-8
[[nodiscard]] engine::Result<std::string> percent_decode(std::string_view text);

/// "/v1/scenes/s%31" is {"v1", "scenes", "s1"}; "/" is {""}. Each segment is decoded after the path is split.
///   errors  as percent_decode(); invalid_argument: no leading slash, a segment "." or "..", one with a slash or a
///           backslash in it
[[nodiscard]] engine::Result<std::vector<std::string>> split_path(std::string_view path);

/// "a=1&b=x+y" is {{"a", "1"}, {"b", "x y"}}.
///   errors  as percent_decode(), with the parameter's name as `where`
[[nodiscard]] engine::Result<std::vector<std::pair<std::string, std::string>>> parse_query(std::string_view query);

/// Whether the bytes are well-formed UTF-8.
[[nodiscard]] bool is_utf8(std::string_view text);

}  // namespace server::http
