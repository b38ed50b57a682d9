#include "proto/log_entry.h"

#include <nlohmann/json.hpp>

#include "proto/time_text.h"

namespace proto {

std::string to_json(const LogEntry& entry) {
  using nlohmann::ordered_json;
  ordered_json json{{"time", rfc3339(entry.time)}, {"level", entry.level}, {"message", entry.message}};
  for (const LogField& field : entry.fields) {
    const auto number = field.is_number ? ordered_json::parse(field.value, nullptr, false) : ordered_json();
    json[field.name] = number.is_number() ? number : ordered_json(field.value);
  }
  return json.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace proto
