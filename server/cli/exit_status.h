// How the program ends: one line on the error stream and a number for scripts.
#pragma once

#include <string>

#include "engine/core/result.h"

namespace server::cli {

/// 0 is success. Each error code has its own number:
///   1 internal       2 invalid_argument, and a wrong command line   3 not_found      4 corrupt_data
///   5 unsupported    6 unprocessable    7 too_large     8 no_space  9 conflict      10 busy
///   11 cancelled     12 unavailable     13 quota_exceeded
[[nodiscard]] int exit_status(engine::ErrorCode code);

/// "error: message (where)", always one line.
[[nodiscard]] std::string error_line(const engine::Error& error);

/// The list above, for --help.
[[nodiscard]] std::string exit_status_help();

}  // namespace server::cli
