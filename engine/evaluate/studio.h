// Where made-up edits take place: a room and a light that suits all that moves in it.
#pragma once

#include <vector>

#include "engine/procedural/light.h"
#include "engine/procedural/surface.h"

namespace engine::evaluate {

/// Even light: what is moved looks the same elsewhere.
[[nodiscard]] procedural::Light studio_light();

/// A room with a table, whose top is at height 0, and two prints on the wall behind it.
[[nodiscard]] std::vector<procedural::Object> furnished_room();

}  // namespace engine::evaluate
