// Answers of the service to requests that it refuses or fails at: application/problem+json (RFC 9457).
#pragma once

#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace proto {

/// One such answer.
struct Problem {
  int status = 500;
  std::string code;    ///< For programs: "invalid_argument", "not_found", ...
  std::string detail;  ///< For people: one sentence.
  std::string where;   ///< Address of the culprit; empty: left out.
  std::string request_id;
};

/// The one HTTP status of each code:
///   invalid_argument 400, unprocessable, corrupt_data and unsupported 422, not_found 404, conflict 409, too_large 413,
///   no_space 507, busy and quota_exceeded 429, cancelled and unavailable 503, internal 500
[[nodiscard]] int http_status(engine::ErrorCode code);

/// The standard phrase of a status: "Not Found".
[[nodiscard]] std::string_view status_phrase(int status);

/// The problem as JSON. Bytes that are no UTF-8 become the replacement character.
[[nodiscard]] std::string to_json(const Problem& problem);

}  // namespace proto
