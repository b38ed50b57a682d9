// Where a part is set down that stands on something: people's handles miss a floor by a little, and mean it.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/deform/motion.h"
#include "engine/deform/rigid.h"
#include "engine/select/footing.h"

namespace engine::edit {

/// Targets with which a part stands on what is by its feet as it stood before: as high above it, and on one floor as
/// upright, if its handles are more than one, none asks for a turn, and they tilt it by less than 10 degrees. Nothing
/// where that takes a handle farther from its target than a twentieth of the longest way, which nobody asks for by
/// mistake, or no farther than a thousandth of it, which nobody sees; nor for a part with an anchor, which says enough.
///   drags   of a group that goes as one piece, by deform::nearest_motion()
///   scales  see there
///   stand   what the part stands on, if that is known, with a motion
///   returns [drags]
[[nodiscard]] std::optional<std::vector<DVec3>> settled(
    std::span<const deform::Drag> drags, bool scales,
    const std::function<std::optional<select::Footings>(const deform::RigidMotion&)>& stand);

}  // namespace engine::edit
