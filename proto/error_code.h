// Names of error codes on the wire.
#pragma once

#include <string_view>

#include "engine/core/result.h"

namespace proto {

/// "invalid_argument", "no_space", ...: the `code` of a problem, and of a failed edit.
[[nodiscard]] std::string_view name_of(engine::ErrorCode code);

}  // namespace proto
