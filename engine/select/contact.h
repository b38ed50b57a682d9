// Where selected rows touch the rest of the scene, and whether they grow out of it or merely stand there.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/scene/overlay.h"

namespace engine::select {

/// What a row is next to.
enum class Touch : std::uint8_t {
  nothing,   ///< No row that is not selected is among those nearest to it, and no farther than these are.
  stands,    ///< One is, but looks otherwise: a cup on a table, a lip on the other.
  grows_out  ///< The surface goes on there, and the part has no weaker border within (firmness.h): an ear on a head.
             ///< Where what goes on is only a rim of table that is selected with a cup, the part stands.
};

/// Of a part of what is selected: where it meets what is not. Looks at the rows of the box around the part, and a
/// little beyond, as far as they show from outside (exposed.h); those that do not are next to nothing.
///   part      rows of the scene, ascending, at least one (asserted), all of them selected
///   selected  ascending
/// About a second for 250,000 rows in the box.
///   returns   [part]
[[nodiscard]] std::vector<Touch> contact_of(const scene::LayeredCloud& scene, std::span<const std::uint32_t> part,
                                            std::span<const std::uint32_t> selected);

}  // namespace engine::select
