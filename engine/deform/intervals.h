// The multi-step schedule of a drag.
// Source: 3DGS-Drag (ICLR 2025), section 3.5, eq. 7; the choice of T is ours.
#pragma once

#include <span>

#include "engine/core/vec.h"

namespace engine::deform {

constexpr int max_intervals = 20;

/// One drag as the schedule sees it. World units.
struct DragLength {
  double distance = 0;  ///< |p_t - p_h|, 0 for an anchor.
  double step = 0;      ///< As far as one interval may go, > 0: tau, say.
};

/// T = ceil(max_i distance_i / step_i), limited to 1..max_intervals. With tau for a step none carries a handle out of
/// its own sphere, unless the drag is longer than 20 radii.
[[nodiscard]] int default_intervals(std::span<const DragLength> drags);

/// p_t'(u) = p_h + (u / T) (p_t - p_h), u = 1..T, from the handle as the user placed it. p_t'(T) is p_t exactly.
[[nodiscard]] DVec3 interval_target(DVec3 source, DVec3 target, int u, int intervals);

}  // namespace engine::deform
