// The way that handles take from where they are to where they go: a part that turns goes round, not straight through.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/deform/motion.h"

namespace engine::deform {

/// `part` of a turn, 0 to 1, about the same axis; of one with w < 0 the long way. All of it is `turn` exactly.
[[nodiscard]] DQuat part_of_turn(const DQuat& turn, double part);

/// The handles of a group go along the screw (a turn about an axis, and a shift along it; Chasles 1830) that comes
/// nearest to taking them to their targets, and what it misses they go straight. So where they go as one piece, they
/// are one all the way. One handle goes straight. Anchors stay.
class Path {
 public:
  explicit Path(std::span<const Drag> drags);

  /// Where handle i is after `part` of the way, 0 to 1; the ends are source and target exactly.
  [[nodiscard]] DVec3 position(std::size_t i, double part) const;
  /// How far it has turned and grown by itself by then: parts of drags[i].turn and .scale.
  [[nodiscard]] std::optional<DQuat> turn(std::size_t i, double part) const;
  [[nodiscard]] double scale(std::size_t i, double part) const;
  /// The most that anything turns all the way, radians.
  [[nodiscard]] double farthest_turn() const;

 private:
  /// Of a group.
  struct Screw {
    DVec3 centre{0.0};
    DQuat turn{1.0, 0.0, 0.0, 0.0};
    DVec3 shift{0.0};  ///< Along the axis; where nothing turns, any way.

    [[nodiscard]] DVec3 operator()(DVec3 point, double part) const;
  };
  [[nodiscard]] static Screw screw_of(std::span<const Drag> drags, int group);

  std::vector<Drag> drags_;
  std::vector<Screw> screw_;  ///< [drags] of its group
};

}  // namespace engine::deform
