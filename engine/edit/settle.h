// Where a part is set down that stands on something: people's handles miss a floor by a little, and mean it.
#pragma once

#include <functional>
#include <optional>
#include <span>

#include "engine/deform/motion.h"
#include "engine/deform/rigid.h"
#include "engine/select/footing.h"

namespace engine::edit {

/// The motion after which a part stands on what is by its feet as it stood before: as high above it, and, if its
/// handles are more than one and none asks for a turn, as upright on a floor. Nothing where that takes a handle farther
/// from its target than a twentieth of the longest way, which nobody asks for by mistake; nor where it makes less than
/// a thousandth of it, which nobody sees.
///   asked  as one piece, in the frame of the drags, like all of this
///   drags  of the group
///   stand  what the part stands on, if that is known, with a motion
[[nodiscard]] std::optional<deform::RigidMotion> settled(
    const deform::RigidMotion& asked, std::span<const deform::Drag> drags,
    const std::function<std::optional<select::Footings>(const deform::RigidMotion&)>& stand);

}  // namespace engine::edit
