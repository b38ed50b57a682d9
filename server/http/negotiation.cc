#include "server/http/negotiation.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <span>

#include "engine/core/checksum.h"
#include "engine/core/numbers.h"
#include "server/http/request_head.h"
#include "server/http/url.h"

namespace server::http {
namespace {

/// How closely "image/*" matches "image/png": 3 exactly, 2 by type, 1 by "*/*", 0 not at all.
int closeness(std::string_view pattern, std::string_view media_type) {
  if (same_ignoring_case(pattern, media_type)) return 3;
  if (pattern == "*/*") return 1;
  const std::size_t slash = pattern.find('/');
  const bool is_family = slash != std::string_view::npos && pattern.substr(slash) == "/*";
  return is_family && same_ignoring_case(pattern.substr(0, slash), media_type.substr(0, media_type.find('/'))) ? 2 : 0;
}

/// Whether a weight is zero: "0", "0.", "0.000".
bool is_zero(std::string_view weight) {
  return !weight.empty() && weight.find_first_not_of("0.") == std::string_view::npos;
}

std::string_view unquoted(std::string_view text) {
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') return text.substr(1, text.size() - 2);
  return text;
}

}  // namespace

bool accepts(std::string_view accept, std::string_view media_type) {
  if (trim(accept).empty()) return true;
  int best = 0;
  bool taken = false;
  for (const std::string_view element : split_list(accept)) {
    const auto parts = split_list(element, ';');
    if (parts.empty()) continue;
    const int match = closeness(parts.front(), media_type);
    if (match <= best) continue;
    best = match;
    taken = std::none_of(parts.begin() + 1, parts.end(), [](std::string_view parameter) {
      return (parameter.starts_with("q=") || parameter.starts_with("Q=")) && is_zero(trim(parameter.substr(2)));
    });
  }
  return taken;
}

bool names_etag(std::string_view if_none_match, std::string_view etag) {
  if (trim(if_none_match) == "*") return true;
  for (std::string_view element : split_list(if_none_match)) {
    if (element.starts_with("W/")) element.remove_prefix(2);
    if (element.size() >= 2 && element.front() == '"' && unquoted(element) == etag) return true;
  }
  return false;
}

std::string etag_of(std::string_view bytes) {
  const std::uint64_t hash = engine::fnv1a(std::as_bytes(std::span(bytes)));
  std::array<char, 16> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), hash, 16).ptr;
  return std::string(text.data(), end) + "-" + std::to_string(bytes.size());
}

RangeChoice choose_range(std::string_view range, std::uint64_t size) {
  constexpr std::string_view unit = "bytes=";
  const std::string_view spec = trim(range.substr(std::min(range.size(), unit.size())));
  const std::size_t dash = spec.find('-');
  if (!same_ignoring_case(range.substr(0, unit.size()), unit) || spec.find(',') != std::string_view::npos ||
      dash == std::string_view::npos)
    return {};
  const auto first = engine::number_in<std::uint64_t>(spec.substr(0, dash)),
             last = engine::number_in<std::uint64_t>(spec.substr(dash + 1));
  const bool open_ended = dash + 1 == spec.size(), suffix = dash == 0;
  if ((!first && !suffix) || (!last && !open_ended) || (suffix && open_ended)) return {};
  if (suffix) {
    if (*last == 0 || size == 0) return {RangeKind::unsatisfiable, {}};
    return {RangeKind::part, {size - std::min(*last, size), size - 1}};
  }
  if (last && *last < *first) return {};
  if (*first >= size) return {RangeKind::unsatisfiable, {}};
  return {RangeKind::part, {*first, std::min(last.value_or(size - 1), size - 1)}};
}

std::string media_type_of(std::string_view content_type) {
  return lower_case(trim(content_type.substr(0, content_type.find(';'))));
}

std::optional<std::string> boundary_of(std::string_view content_type) {
  const auto parts = split_list(content_type, ';');
  for (const std::string_view part : parts) {
    const std::size_t equals = part.find('=');
    if (equals == std::string_view::npos || !same_ignoring_case(trim(part.substr(0, equals)), "boundary")) continue;
    const std::string_view boundary = unquoted(trim(part.substr(equals + 1)));
    const bool sane = std::all_of(boundary.begin(), boundary.end(), [](char c) {
      return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
             std::string_view("'()+_,-./:=?").find(c) != std::string_view::npos;
    });
    if (boundary.empty() || boundary.size() > 70 || !sane) return std::nullopt;
    return std::string(boundary);
  }
  return std::nullopt;
}

std::string_view media_type_of_file(std::string_view name) {
  struct Type {
    std::string_view ending, media_type;
  };
  constexpr std::array types{Type{".html", "text/html; charset=utf-8"},
                             Type{".css", "text/css; charset=utf-8"},
                             Type{".js", "text/javascript; charset=utf-8"},
                             Type{".mjs", "text/javascript; charset=utf-8"},
                             Type{".json", "application/json"},
                             Type{".svg", "image/svg+xml"},
                             Type{".png", "image/png"},
                             Type{".jpg", "image/jpeg"},
                             Type{".ico", "image/x-icon"},
                             Type{".woff2", "font/woff2"},
                             Type{".wasm", "application/wasm"},
                             Type{".yaml", "application/yaml"},
                             Type{".txt", "text/plain; charset=utf-8"}};
  for (const Type& type : types)
    if (name.ends_with(type.ending)) return type.media_type;
  return "application/octet-stream";
}

std::string base_name(std::string_view filename) {
  filename = filename.substr(filename.find_last_of("/\\") + 1);  // npos + 1 is 0
  std::string name;
  for (const char c : filename)
    if (static_cast<unsigned char>(c) >= 0x20 && c != 0x7f) name += c;
  if (!is_utf8(name))
    for (char& c : name)
      if (static_cast<unsigned char>(c) >= 0x80) c = '_';
  constexpr std::size_t max_bytes = 255;
  if (name.size() > max_bytes) {
    name.resize(max_bytes);
    while (!name.empty() && !is_utf8(name)) name.pop_back();
  }
  return name == "." || name == ".." ? std::string() : name;
}

}  // namespace server::http
