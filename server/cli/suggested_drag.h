// The drags that the demo scene suggests, as requests.
#pragma once

#include "engine/procedural/demo_scene.h"
#include "proto/edit_request.h"

namespace server::cli {

/// The request that carries the drag out.
[[nodiscard]] proto::EditRequest to_request(const engine::procedural::SuggestedDrag& drag);

}  // namespace server::cli
