// Selections read out of a JSON document, and written into one. For the .cc files of this room.
#pragma once

#include <nlohmann/json.hpp>

#include "proto/json_fields.h"
#include "proto/selection.h"

namespace proto {

/// The operations of a list.
[[nodiscard]] Selection read_selection(const JsonField& field);

[[nodiscard]] nlohmann::ordered_json encode(const Selection& selection);

}  // namespace proto
