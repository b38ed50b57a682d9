// Points in time as the wire writes them.
#pragma once

#include <chrono>
#include <string>

namespace proto {

/// RFC 3339, UTC, milliseconds: "2026-11-21T11:09:38.123Z".
[[nodiscard]] std::string rfc3339(std::chrono::sys_time<std::chrono::milliseconds> time);

}  // namespace proto
