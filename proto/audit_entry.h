// One line of the audit log, for programs.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace proto {

/// A request that was to change something, or was refused for its token.
struct AuditEntry {
  std::chrono::sys_time<std::chrono::milliseconds> time;
  std::string request_id;
  std::string token;    ///< Name of the token; empty: none is known.
  std::string address;  ///< Of the client.
  std::string method;
  std::string route;  ///< As declared: "/v1/scenes/{id}"; "-": there is none.
  /// What it was about: "scene" and "s000001", "edit" and "e000001".
  std::vector<std::pair<std::string, std::string>> about;
  int status = 0;
  std::string refusal;  ///< Code of the error; empty: it was done.
};

/// {"time":"2026-11-21T11:09:38.123Z","request_id":"...","token":"studio","address":"10.0.0.7","method":"DELETE",
/// "route":"/v1/scenes/{id}","scene":"s000001","status":204}: one line. Bytes that are no UTF-8 become the replacement
/// character; what is longer than any id is cut.
[[nodiscard]] std::string to_json(const AuditEntry& entry);

/// So many lines could not be written since the process began: {"time":"...","lost":3}
[[nodiscard]] std::string lost_lines_json(std::chrono::sys_time<std::chrono::milliseconds> time, std::uint64_t lost);

}  // namespace proto
