// What a part grows out of, and whether that goes on the same along a direction: a pole, a neck with its frets.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/scene/overlay.h"
#include "engine/select/contact.h"

namespace engine::select {

/// One piece of what repeats; all of it shifted by `step` once, twice and so on is what goes on.
struct Repeat {
  DVec3 step{0.0};                  ///< One period along the pull, world units.
  std::vector<std::uint32_t> tile;  ///< Rows of the scene within the last period of it, ascending.
  std::vector<double> depth;        ///< [tile] how far before the cut they are, along the pull; above 0.
  std::vector<std::uint32_t>
      stays;  ///< Rows of the part before the cut: what repeats belongs to what stays. Ascending.
};

/// The rest before a part, looked at along the pull: where its surfaces come back, in the same place across the pull
/// and in the same colours, after some length. Of several lengths that fit alike the longest, as it repeats the least;
/// a pole of one colour has any. The cut is where that ends, within the part if need be: of a knob that is selected
/// with a piece of its pole, only the knob is drawn out.
///   part     rows of the scene, ascending, at least one
///   touches  [part] of contact_of()
///   pull     where the part goes, world units, not zero
///   limit    how far from the origin along the pull the cut may be at most: a level of dot(mean, pull / |pull|)
///   returns  nothing if it touches nothing, or if what is before it is no such thing
[[nodiscard]] std::optional<Repeat> find_repeat(const scene::LayeredCloud& scene, std::span<const std::uint32_t> part,
                                                std::span<const Touch> touches, DVec3 pull, double limit);

}  // namespace engine::select
