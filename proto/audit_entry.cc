#include "proto/audit_entry.h"

#include <nlohmann/json.hpp>

#include "proto/time_text.h"

namespace proto {
namespace {

using nlohmann::ordered_json;

/// Most bytes of a part of a path. A choice: ids are shorter, and whoever sends longer ones is not to fill the disk.
constexpr std::size_t max_value_bytes = 100;

std::string line_of(const ordered_json& json) {
  return json.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace

std::string to_json(const AuditEntry& entry) {
  ordered_json json{{"time", rfc3339(entry.time)}, {"request_id", entry.request_id}};
  json["token"] = entry.token.empty() ? ordered_json() : ordered_json(entry.token);
  json["address"] = entry.address;
  json["method"] = entry.method;
  json["route"] = entry.route;
  for (const auto& [name, value] : entry.about) json[name] = value.substr(0, max_value_bytes);
  json["status"] = entry.status;
  if (!entry.refusal.empty()) json["refused"] = entry.refusal;
  return line_of(json);
}

std::string lost_lines_json(std::chrono::sys_time<std::chrono::milliseconds> time, std::uint64_t lost) {
  return line_of({{"time", rfc3339(time)}, {"lost", lost}});
}

}  // namespace proto
