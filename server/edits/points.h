// Points of the wire as vectors, and back.
#pragma once

#include "engine/core/vec.h"
#include "proto/edit_request.h"

namespace server::edits {

[[nodiscard]] inline engine::DVec3 to_vec(const proto::Point& point) { return {point[0], point[1], point[2]}; }
[[nodiscard]] inline proto::Point to_point(engine::DVec3 v) { return {v.x, v.y, v.z}; }

}  // namespace server::edits
