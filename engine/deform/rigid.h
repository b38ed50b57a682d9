// Handles that ask for one rigid motion: then no handle needs to guess from its neighbours how it turns.
// Source: Horn 1987, "Closed-form solution of absolute orientation using unit quaternions".
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/deform/motion.h"

namespace engine::deform {

/// Where the handles of a group are and go; an anchor goes nowhere. In the order of the drags.
struct Places {
  std::vector<DVec3> from, to;
  double longest = 0;  ///< Way.
  double extent = 0;   ///< Farthest of all from the origin.
  std::size_t anchors = 0;
};
[[nodiscard]] Places places_of(std::span<const Drag> drags, int group);

/// A turn about `centre`, a growth from there, and the shift after it.
struct RigidMotion {
  DVec3 centre{0.0};
  DQuat turn{1.0, 0.0, 0.0, 0.0};  ///< Unit.
  DVec3 shift{0.0};
  double scale = 1;     ///< Above 0; 1 but for fit_similarity().
  double residual = 0;  ///< Farthest that a point is from where the motion takes it, units of the points.

  [[nodiscard]] DVec3 operator()(DVec3 point) const { return centre + scale * (turn * (point - centre)) + shift; }
};

/// The motion that takes `from` to `to` with the least squares, and of equally good ones the one that turns least.
/// Points in one place do not turn. Nor does a half-turn, of which none is the least: its residual tells.
/// Precondition: as many points as targets.
///   slack  motions whose residuals differ by no more are equally good, about: points in a row, but for that much, say
///          nothing of a turn about the row. Units of the points.
[[nodiscard]] RigidMotion fit_rigid(std::span<const DVec3> from, std::span<const DVec3> to, double slack = 0);

/// Do three of the points span a plane? Then only one rigid motion takes them to their targets.
[[nodiscard]] bool span_a_plane(std::span<const DVec3> points);

/// fit_rigid(), but of points that span a plane also a half-turn, which is then the only one.
[[nodiscard]] RigidMotion fit_any_turn(std::span<const DVec3> from, std::span<const DVec3> to);

/// fit_any_turn() with the scale of least squares. Points in one place do not scale.
/// Source: Horn 1987, section 2.D.
[[nodiscard]] RigidMotion fit_similarity(std::span<const DVec3> from, std::span<const DVec3> to);

/// Do the handles of the group move as one piece, to a hundredth of the longest way? Anchors count as points that stay.
/// A group without handles does.
[[nodiscard]] bool moves_as_one_piece(std::span<const Drag> drags, int group);

/// Where a group moves as one piece, all its handles turn as the piece does, in place of the blend of pairs that
/// handle_motions() gives them. Anchors still do not turn.
void turn_whole_groups(std::span<const Drag> drags, std::span<HandleMotion> motions);

}  // namespace engine::deform
