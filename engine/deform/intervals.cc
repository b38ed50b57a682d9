#include "engine/deform/intervals.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace engine::deform {

int default_intervals(std::span<const DragLength> drags) {
  double longest = 1;
  for (const DragLength& drag : drags) longest = std::max(longest, drag.distance / drag.step);
  // The user's 0.3 over 0.1 may come out as 3.0000000000000004; that is three steps, not four.
  constexpr double rounding = 1e-9;
  return int(std::min(std::ceil(longest * (1 - rounding)), double(max_intervals)));
}

DVec3 interval_target(DVec3 source, DVec3 target, int u, int intervals) {
  assert(1 <= u && u <= intervals);
  if (u == intervals) return target;  // source + (target - source) may differ from it in the last bit
  return source + (double(u) / intervals) * (target - source);
}

}  // namespace engine::deform
