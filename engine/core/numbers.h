// Whole numbers as text, and the ids that count up.
#pragma once

#include <charconv>
#include <concepts>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

namespace engine {

/// The number that all of the text is, in decimal digits, with a minus where the type has one. Nothing for any other
/// text, and for a number that the type does not hold.
template <std::integral Number>
[[nodiscard]] std::optional<Number> number_in(std::string_view text) {
  Number number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}

/// "s000007" for the seventh thing of kind 's': six digits, or more where six do not hold the number.
[[nodiscard]] inline std::string numbered_id(char kind, std::uint64_t number) {
  const std::string digits = std::to_string(number);
  return kind + std::string(digits.size() < 6 ? 6 - digits.size() : 0, '0') + digits;
}

/// 7 for "s000007"; nothing for a text that numbered_id() does not write.
[[nodiscard]] inline std::optional<std::uint64_t> number_of_id(char kind, std::string_view id) {
  const auto number = id.empty() ? std::nullopt : number_in<std::uint64_t>(id.substr(1));
  return number && numbered_id(kind, *number) == id ? number : std::nullopt;
}

}  // namespace engine
