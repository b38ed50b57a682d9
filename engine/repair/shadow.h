// The shadow that a part casts on what it stands on, or next to. It belongs to the part: left behind, it is a stain.
#pragma once

#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/repair/around_part.h"

namespace engine::repair {

/// A surface beside a part is in its shadow where it is darker than the same surface farther away is, by more than its
/// texture is from place to place, all the way from the part, within one extent of it. The same surface: what lies in
/// one plane with it, or bends as gently, and has colours as like. What begins beside the part, or darkens away from
/// it, is no shadow of it (docs/adr/0061-a-shadow-begins-at-the-part-and-fades.md).
class Shadow {
 public:
  explicit Shadow(AroundPart around);
  [[nodiscard]] bool empty() const { return reach_ == 0; }
  /// What is left of the light, by channel: 0 to 1, factors of display-referred colours. 1 beside the shadow, and off
  /// the surfaces that it falls on.
  ///   points  world units
  [[nodiscard]] std::vector<Vec3> light_at(std::span<const DVec3> points) const;
  /// World units; points farther from middle() than that are beside it.
  [[nodiscard]] double reach() const { return around_.extent * double(reach_); }
  [[nodiscard]] DVec3 middle() const { return around_.middle; }
  [[nodiscard]] double extent() const { return around_.extent; }  ///< Of the part, world units.

 private:
  AroundPart around_;
  std::vector<Vec3> light_;  ///< [n]
  float reach_ = 0;          ///< Extents of the part; 0: there is no shadow.
};

}  // namespace engine::repair
