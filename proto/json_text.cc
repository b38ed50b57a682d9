#include "proto/json_text.h"

#include <cstddef>

namespace proto {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t line_length = 100;  // characters that an array or object may take on its line; a choice

std::string scalar(const ordered_json& value) {
  return value.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

/// `"name": ` of a member, nothing of an array's element.
template <class Member>
std::string label(const ordered_json& parent, const Member& member) {
  return parent.is_object() ? scalar(member.key()) + ": " : std::string();
}

std::string on_one_line(const ordered_json& value) {
  if (!value.is_structured()) return scalar(value);
  std::string text;
  for (const auto& member : value.items())
    text += (text.empty() ? "" : ", ") + label(value, member) + on_one_line(member.value());
  return value.is_object() ? "{" + text + "}" : "[" + text + "]";
}

std::string indented(const ordered_json& value, std::size_t indent) {
  std::string line = on_one_line(value);
  if (!value.is_structured() || value.empty() || indent + line.size() <= line_length) return line;
  const std::string margin(indent + 2, ' ');
  std::string text;
  for (const auto& member : value.items())
    text += (text.empty() ? "" : ",\n") + margin + label(value, member) + indented(member.value(), indent + 2);
  const std::string end = "\n" + std::string(indent, ' ');
  return value.is_object() ? "{\n" + text + end + "}" : "[\n" + text + end + "]";
}

}  // namespace

std::string pretty(const ordered_json& value) { return indented(value, 0); }

}  // namespace proto
