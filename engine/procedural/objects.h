// Things to put into a made-up scene. Each stands on its placement's position; lengths in world units.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/procedural/surface.h"

namespace engine::procedural {

/// Floor at `floor_height` (negative: the table top is at 0), a back wall and two side walls; open to the viewer.
[[nodiscard]] Object make_room(float floor_height);
/// Its top is at height 0 and its middle at the placement.
[[nodiscard]] Object make_table(Placement placement, Vec3 width_leg_depth);
[[nodiscard]] Object make_framed_print(Placement middle, float width, float height);
[[nodiscard]] Object make_ball(Placement placement, float radius, Vec3 glaze, Vec3 stripe);
[[nodiscard]] Object make_mug(Placement placement);
[[nodiscard]] Object make_apple(Placement placement, float radius);
[[nodiscard]] Object make_book(Placement placement, Vec3 width_thickness_depth, Vec3 cover);
/// A saucer, a pot and soil in it.
[[nodiscard]] Object make_pot(Placement placement);
constexpr float soil_height = 0.53f;  ///< Above the foot of make_pot().

/// Leaves on long stalks, in a rosette out of the soil of a pot at the same placement.
struct Plant {
  Object object;
  std::vector<Blade> blades;  ///< In the object's frame: blade i is patch 2 i, its stalk patch 2 i + 1.
};
[[nodiscard]] Plant make_plant(Placement placement, int leaves, std::uint64_t seed);

}  // namespace engine::procedural
