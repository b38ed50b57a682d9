#include "tests/house/house_rules.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <regex>
#include <sstream>
#include <string_view>
#include <utility>

namespace house {
namespace {

/// Headers that only some rooms may include.
struct Reserved {
  std::string header;           ///< Begins with this.
  std::set<std::string> rooms;  ///< Which may; nobody else.
  bool in_headers = true;       ///< May their headers, too?
};

const std::vector<Reserved>& reserved() {
  static const std::vector<Reserved> list = {
      {"flann/", {"engine/neighbours"}},
      {"Eigen/", {"engine/elastic", "engine/repair"}, false},
      {"torch/", {"engine/diffusion"}, false},
      {"ATen/", {"engine/diffusion"}, false},
      {"c10/", {"engine/diffusion"}, false},
      {"utf8proc", {"engine/diffusion"}, false},
      {"OpenImageIO/", {"engine/io"}},
      {"OpenEXR/", {"engine/io"}},
      {"zlib.h", {"engine/io"}},
      {"zstd.h", {"engine/io"}},
      {"nlohmann/", {"engine/io", "engine/weights", "proto", "server/cli", "server/scenes/catalogue"}},
      {"tbb/", {"engine/core"}},
      {"oneapi/", {"engine/core"}},
      {"sqlite3.h", {"engine/jobs"}},
      {"libpq-fe.h", {"engine/jobs"}, false},
      {"httplib.h", {"server/http"}, false},
      {"CLI/", {"server/cli"}},
      {"toml++/", {"server/cli"}},
      {"spdlog/", {"server/cli", "server/http", "server/edits", "server/service"}},
      {"prometheus/", {"server/http"}, false},
      {"zip.h", {"engine/io", "server/scenes/uploads"}, false},
      {"webp/", {"engine/io"}, false},
      {"xxh", {"engine/weights", "server/scenes/disk"}, false}};
  return list;
}

/// Room that a path from the root lies in: "engine/render/forward.h" is in "engine/render"; "" if in none. The
/// innermost folder that is declared as a room counts: "server/scenes/disk/scratch.h" is in "server/scenes/disk".
std::string room_of(const Arrows& arrows, const std::string& path) {
  const std::size_t first = path.find('/');
  if (first == std::string::npos) return {};
  const std::string top = path.substr(0, first);
  if (top != "engine" && top != "proto" && top != "server") return {};
  for (std::size_t end = path.rfind('/'); end != std::string::npos; end = path.rfind('/', end - 1))
    if (arrows.contains(path.substr(0, end))) return path.substr(0, end);
  const std::size_t second = path.find('/', first + 1);
  if (top == "engine") return second == std::string::npos ? std::string() : path.substr(0, second);
  return top;
}

/// "engine_render" is the library of "engine/render", "server_scenes_disk" that of "server/scenes/disk",
/// "splatdrag_proto" that of "proto".
std::string folder_of(std::string target) {
  if (target.starts_with("splatdrag_")) return target.substr(10);
  std::replace(target.begin(), target.end(), '_', '/');
  return target;
}

/// The line without `word` at its start; nothing if it starts with something else. Space before either is skipped.
std::optional<std::string_view> after(std::string_view line, std::string_view word) {
  line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  if (!line.starts_with(word)) return std::nullopt;
  line.remove_prefix(word.size());
  line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  return line;
}

struct Include {
  std::string header;
  bool quoted = false;
};

/// The header that a line includes, if it does.
std::optional<Include> included(std::string_view line) {
  const auto directive = after(line, "#");
  const auto name = directive ? after(*directive, "include") : std::nullopt;
  if (!name || name->empty() || (name->front() != '"' && name->front() != '<')) return std::nullopt;
  const bool quoted = name->front() == '"';
  const std::size_t end = name->find(quoted ? '"' : '>', 1);
  if (end == std::string_view::npos) return std::nullopt;
  return Include{std::string(name->substr(1, end - 1)), quoted};
}

bool is_using_namespace(std::string_view line) {
  const auto rest = after(line, "using ");
  return rest && rest->starts_with("namespace ");
}

std::string check_project_include(const Arrows& arrows, const std::string& room, const std::string& header) {
  const std::string other = room_of(arrows, header);
  if (other.empty()) return "\"" + header + "\" is no path from the root into a room";
  if (other == room) return {};
  const auto uses = arrows.find(room);
  if (uses != arrows.end() && uses->second.contains(other)) return {};
  return room + " includes " + other + ", which its USES does not declare";
}

std::string check_library_include(const std::string& room, bool in_header, const std::string& header) {
  for (const Reserved& rule : reserved()) {
    if (!header.starts_with(rule.header)) continue;
    if (!rule.rooms.contains(room)) return "<" + header + "> does not belong into " + room;
    if (in_header && !rule.in_headers) return "<" + header + "> belongs into .cc files only";
  }
  return {};
}

/// Name that a line calls of <algorithm>, with or without `ranges`; "" if none. Comments do not count.
std::string algorithm_called(const std::string& line) {
  static const std::regex call(
      R"(\bstd::(ranges::)?(adjacent_find|all_of|any_of|binary_search|clamp|copy(_if|_n)?|count(_if)?|equal(_range)?|)"
      R"(fill(_n)?|find(_if(_not)?|_first_of|_end)?|for_each(_n)?|generate(_n)?|includes|inplace_merge|is_sorted(_until)?|)"
      R"(is_permutation|lexicographical_compare|lower_bound|upper_bound|make_heap|push_heap|pop_heap|sort_heap|)"
      R"((min|max|minmax)(_element)?|merge|mismatch|none_of|nth_element|partial_sort|partition(_point)?|remove(_if|_copy)?|)"
      R"(replace(_if)?|reverse|rotate|search|set_(difference|intersection|union)|shuffle|sort|stable_(sort|partition)|)"
      R"(transform|unique)[(<])");
  const std::string code = line.substr(0, line.find("//"));
  std::smatch found;
  return std::regex_search(code, found, call) ? found[2].str() : std::string();
}

}  // namespace

Arrows parse_arrows(const std::string& text) {
  Arrows arrows;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos) continue;
    auto& uses = arrows[line.substr(0, colon)];
    std::istringstream targets(line.substr(colon + 1));
    for (std::string target; targets >> target;) uses.insert(folder_of(target));
  }
  return arrows;
}

std::vector<std::string> find_circle(const Arrows& arrows) {
  std::vector<std::string> path, circle;
  std::set<std::string> finished;
  const std::function<void(const std::string&)> visit = [&](const std::string& room) {
    if (!circle.empty() || finished.contains(room)) return;
    const auto seen = std::find(path.begin(), path.end(), room);
    if (seen != path.end()) {
      circle.assign(seen, path.end());
      circle.push_back(room);
      return;
    }
    path.push_back(room);
    if (const auto uses = arrows.find(room); uses != arrows.end())
      for (const std::string& used : uses->second) visit(used);
    path.pop_back();
    finished.insert(room);
  };
  for (const auto& [room, uses] : arrows) visit(room);
  return circle;
}

std::vector<std::string> violations(const Arrows& arrows, const std::string& file, const std::string& source) {
  std::vector<std::string> found;
  const std::string room = room_of(arrows, file);
  const bool is_header = file.ends_with(".h"), is_source = file.ends_with(".cc");
  if (!arrows.contains(room)) found.push_back(file + ": lies in no room that CMake knows");
  bool once = false;
  int number = 0;
  std::istringstream lines(source);
  for (std::string line; std::getline(lines, line);) {
    ++number;
    const auto report = [&](const std::string& what) {
      if (!what.empty()) found.push_back(file + ":" + std::to_string(number) + ": " + what);
    };
    if (const auto include = included(line)) {
      const bool of_project = include->quoted || !room_of(arrows, include->header).empty();
      report(of_project ? check_project_include(arrows, room, include->header)
                        : check_library_include(room, !is_source, include->header));
    }
    if (!is_source && is_using_namespace(line)) report("a header says `using namespace`");
    once = once || line.starts_with("#pragma once");
  }
  if (is_header && !once) found.push_back(file + ": a header without #pragma once");
  return found;
}

std::vector<std::string> violations(const Arrows& arrows, const std::map<std::string, std::string>& files) {
  std::set<std::string> checked;
  std::vector<std::string> found, next;
  const auto check = [&](const std::string& file) {
    if (files.contains(file) && checked.insert(file).second) next.push_back(file);
  };
  for (const auto& [file, source] : files)
    if (file.ends_with(".h") || file.ends_with(".cc")) check(file);
  while (!next.empty()) {
    const std::string file = next.back();
    next.pop_back();
    for (std::string& violation : violations(arrows, file, files.at(file))) found.push_back(std::move(violation));
    std::istringstream lines(files.at(file));
    for (std::string line; std::getline(lines, line);)
      if (const auto include = included(line)) check(include->header);
  }
  for (const auto& [file, source] : files)
    if (file.ends_with(".inc") && !checked.contains(file)) found.push_back(file + ": nobody includes it");
  return found;
}

std::vector<std::string> lacks_includes(const std::string& file, const std::string& source) {
  std::string first;
  int number = 0;
  std::istringstream lines(source);
  for (std::string line; std::getline(lines, line);) {
    ++number;
    const auto include = included(line);
    if (include && include->header == "algorithm") return {};
    if (!first.empty() || include || line.find("std::") == std::string::npos) continue;
    if (const std::string name = algorithm_called(line); !name.empty())
      first = file + ":" + std::to_string(number) + ": calls std::" + name + " and does not include <algorithm>";
  }
  if (first.empty()) return {};
  return {first};
}

}  // namespace house
