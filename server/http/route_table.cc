#include "server/http/route_table.h"

#include <algorithm>
#include <optional>

namespace server::http {
namespace {

std::vector<std::string> split(std::string_view path) {
  std::vector<std::string> segments;
  for (std::size_t begin = 1; begin <= path.size();) {
    const std::size_t end = std::min(path.find('/', begin), path.size());
    segments.emplace_back(path.substr(begin, end - begin));
    begin = end + 1;
  }
  return segments;
}

bool is_open(const std::string& segment) {
  return segment.size() > 2 && segment.front() == '{' && segment.back() == '}';
}

/// "id" of "{id}".
std::string name_in(const std::string& open_segment) { return open_segment.substr(1, open_segment.size() - 2); }

/// "scene" of "scenes".
std::string singular(std::string plural) {
  if (plural.ends_with('s')) plural.pop_back();
  return plural;
}

/// Which segments are spelt out, as a text whose order is that of preference; nothing if the path does not match.
std::optional<std::string> fit(const std::vector<std::string>& pattern, const std::vector<std::string>& path) {
  if (pattern.size() != path.size()) return std::nullopt;
  std::string spelt;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const bool open = is_open(pattern[i]);
    if (open ? path[i].empty() : pattern[i] != path[i]) return std::nullopt;
    spelt += open ? '0' : '1';
  }
  return spelt;
}

}  // namespace

std::vector<NamedThing> things_named(const RouteMatch& match) {
  std::vector<NamedThing> things;
  if (match.route == nullptr) return things;
  const auto segments = split(match.route->path);
  for (std::size_t i = 1; i < segments.size(); ++i) {
    if (!is_open(segments[i])) continue;
    const auto value = match.values.find(name_in(segments[i]));
    if (value != match.values.end()) things.emplace_back(singular(segments[i - 1]), value->second);
  }
  return things;
}

std::optional<NamedThing> thing_at_end(std::string_view path) {
  const auto segments = split(path);
  if (segments.size() < 2) return std::nullopt;
  return NamedThing{singular(segments[segments.size() - 2]), segments.back()};
}

RouteTable::RouteTable(Router router) : router_(std::move(router)) {
  for (const Route& route : router_.routes())
    segments_.push_back(route.path == "/" ? std::vector<std::string>{""} : split(route.path));
}

RouteMatch RouteTable::find(std::string_view method, const std::vector<std::string>& segments) const {
  const std::string_view wanted = method == "HEAD" ? "GET" : method;
  RouteMatch match;
  std::string best;
  std::vector<std::string> methods;
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    const auto fitting = fit(segments_[i], segments);
    if (!fitting) continue;
    const Route& route = router_.routes()[i];
    methods.push_back(route.method);
    if (route.method == "GET") methods.push_back("HEAD");
    if (route.method != wanted || (match.route != nullptr && *fitting <= best)) continue;
    match.route = &route;
    best = *fitting;
    match.values.clear();
    for (std::size_t k = 0; k < segments.size(); ++k)
      if (is_open(segments_[i][k])) match.values[name_in(segments_[i][k])] = segments[k];
  }
  std::sort(methods.begin(), methods.end());
  methods.erase(std::unique(methods.begin(), methods.end()), methods.end());
  for (const std::string& name : methods) match.allow += (match.allow.empty() ? "" : ", ") + name;
  return match;
}

}  // namespace server::http
