// What a part stands on, where it is and where it arrives.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "engine/core/vec.h"
#include "engine/scene/overlay.h"
#include "engine/select/contact.h"

namespace engine::select {

/// The surface by the feet of a part: a plane, about, as far as they reach.
struct Footing {
  DVec3 normal{0.0};  ///< Unit, to the side where the part is.
  DVec3 foot{0.0};    ///< The middle of the feet, world units.
  double height = 0;  ///< Of that middle above the surface, world units; below zero where it is sunk in.
};

/// Of one part at both ends of its way. Where both ends are on one plane, its normal is the same.
struct Footings {
  Footing before, after;
};

/// Feet are what is lowest of the part above the surface: so a ball that rolls has others when it arrives.
///   part     rows of the scene, ascending, at least one (asserted)
///   touches  [part] of contact_of()
///   moved    all rows that move, ascending: no surface of theirs counts
///   arrived  [part] where its rows go, world units
///   returns  nothing where the part touches too little, or what is by its feet is no plane at one of the ends
[[nodiscard]] std::optional<Footings> footings_of(const scene::LayeredCloud& scene, std::span<const std::uint32_t> part,
                                                  std::span<const Touch> touches, std::span<const std::uint32_t> moved,
                                                  std::span<const DVec3> arrived);

}  // namespace engine::select
