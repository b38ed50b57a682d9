// JSON for people: short things on one line.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace proto {

/// Indents by two; an array or object that fits stays on its line. Bytes of a string that are no UTF-8 become the
/// replacement character.
[[nodiscard]] std::string pretty(const nlohmann::ordered_json& value);

}  // namespace proto
