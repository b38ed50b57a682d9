// The shadow that a part casts on what it stands on, or next to. It belongs to the part: left behind, it is a stain.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/neighbours/point_index.h"
#include "engine/repair/surroundings.h"

namespace engine::repair {

/// A surface beside a part is in its shadow where it is darker than the same surface farther away is, by more than its
/// texture is from place to place, all the way from the part. The same surface: what lies in one plane with it, or
/// bends as gently, and has colours as like.
class Shadow {
 public:
  explicit Shadow(Surroundings around);
  [[nodiscard]] bool empty() const { return points_ == 0; }
  /// What is left of the light, by channel: 0 to 1, factors of display-referred colours. 1 beside the shadow, and off
  /// the surfaces that it falls on.
  ///   points  world units
  [[nodiscard]] std::vector<Vec3> light_at(std::span<const DVec3> points) const;
  /// World units; points farther from middle() than that are beside it.
  [[nodiscard]] double reach() const;
  [[nodiscard]] DVec3 middle() const { return around_.middle; }
  /// Points of the surroundings that are in it.
  [[nodiscard]] std::size_t points() const { return points_; }

 private:
  Surroundings around_;
  std::vector<Vec3> light_;  ///< [n]
  std::optional<neighbours::PointIndex> index_;
  std::size_t points_ = 0;
};

}  // namespace engine::repair
