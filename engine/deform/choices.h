// What can be chosen about the motion of a drag; motion.h says what the choices do.
#pragma once

#include <array>

#include "engine/core/names.h"

namespace engine::deform {

/// How the rotation of a pair of handles becomes a quaternion.
enum class Rotation {
  shortest_arc,  ///< The least rotation that turns the pair to where it goes.
  paper,         ///< The quaternion as the paper prints it, which turns by twice the angle.
  none,
};
constexpr auto names_of(Rotation) {
  return std::array{Name{Rotation::shortest_arc, "shortest_arc"}, Name{Rotation::paper, "paper"},
                    Name{Rotation::none, "none"}};
}

/// How a Gaussian follows the handles near it.
enum class Interpolation {
  paper,   ///< Weighted sum over the K nearest handles. Jumps where the set of nearest handles changes.
  smooth,  ///< The same with weights that are continuous in space.
  rigid,   ///< The weights of `smooth`, and each handle also turns the space around it (see rigid.h, too).
  arap,    ///< As an elastic body that stays as rigid as possible between its handles (see body.h).
};
constexpr auto names_of(Interpolation) {
  return std::array{Name{Interpolation::paper, "paper"}, Name{Interpolation::smooth, "smooth"},
                    Name{Interpolation::rigid, "rigid"}, Name{Interpolation::arap, "arap"}};
}

/// What holds a part that moves as an elastic body, where it meets the rest of the scene.
enum class Attach {
  automatic,  ///< As handles and contact suggest: see attach.h.
  held,       ///< Its rim stays, and the motion fades towards it.
  free,       ///< It is a body of its own.
};
constexpr auto names_of(Attach) {
  return std::array{Name{Attach::automatic, "auto"}, Name{Attach::held, "held"}, Name{Attach::free, "free"}};
}

}  // namespace engine::deform
