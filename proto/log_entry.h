// One line of the service's log, for programs.
#pragma once

#include <chrono>
#include <string>
#include <vector>

namespace proto {

struct LogField {
  std::string name;
  std::string value;
  bool is_number = false;  ///< The value stands without quotes.
};

struct LogEntry {
  std::chrono::sys_time<std::chrono::milliseconds> time;
  std::string level, message;
  std::vector<LogField> fields;
};

/// {"time":"2026-11-21T11:09:38.123Z","level":"info","message":"...", fields}: one line. Bytes that are no UTF-8 become
/// the replacement character.
[[nodiscard]] std::string to_json(const LogEntry& entry);

}  // namespace proto
