// What a part stands on, where it is and where it arrives.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/scene/overlay.h"
#include "engine/select/contact.h"

namespace engine::select {

/// The surface by the feet of a part: a plane, about, as far as they reach.
struct Footing {
  DVec3 normal{0.0};  ///< Unit, to the side where the part is before its way.
  DVec3 foot{0.0};    ///< The middle of the feet, world units.
  double height = 0;  ///< Of that middle above the surface, world units; below zero where it is sunk in.
};

/// Of one part at both ends of its way. Where both ends are on one plane, its normal is the same.
struct Footings {
  Footing before, after;
};

/// How a part stands where it is, and so where it would with a motion.
/// Feet are what is lowest of the part above the surface: so a ball that rolls has others when it arrives.
class Stance {
 public:
  /// Some 10 ms where 10,000 rows are around the part, of which it looks at 20,000 at most; half of that for each
  /// motion. Both look over all means.
  ///   means    of the scene
  ///   part     rows of the scene, ascending, at least one (asserted)
  ///   touches  [part] of contact_of()
  ///   moved    all rows that move, ascending: no surface of theirs counts
  Stance(const scene::LayeredCloud& scene, const Array3& means, std::span<const std::uint32_t> part,
         std::span<const Touch> touches, std::span<const std::uint32_t> moved);

  /// Nothing where the part touches too little, or what is by its feet is no plane at one of the ends.
  ///   scene, means  those of the constructor
  ///   motion        of world units
  [[nodiscard]] std::optional<Footings> after(const scene::LayeredCloud& scene, const Array3& means,
                                              const std::function<DVec3(DVec3)>& motion) const;

  [[nodiscard]] std::size_t size() const;  ///< Rows and points that it keeps.
  /// Would the constructor make the same of these? What touches follows from them.
  [[nodiscard]] bool is_of(std::span<const std::uint32_t> part, std::span<const std::uint32_t> moved) const;

 private:
  struct Before;
  std::vector<std::uint32_t> part_, moved_;
  std::shared_ptr<const Before> before_;  ///< Null: it stands on nothing.
};

}  // namespace engine::select
