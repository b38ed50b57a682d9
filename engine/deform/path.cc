#include "engine/deform/path.h"

#include <algorithm>
#include <cmath>

#include "engine/deform/rigid.h"

namespace engine::deform {
namespace {

/// Of a unit quaternion, 0 to 2 pi: above pi for w < 0.
double angle_of(const DQuat& turn) { return 2 * std::atan2(glm::length(DVec3(turn.x, turn.y, turn.z)), turn.w); }

}  // namespace

DQuat part_of_turn(const DQuat& turn, double part) {
  const DVec3 axis(turn.x, turn.y, turn.z);
  const double sine = glm::length(axis);
  if (part >= 1) return turn;
  if (!(sine > 0)) return {1, 0, 0, 0};  // no turn, or a full one about no axis
  const double half = std::atan2(sine, turn.w) * part;
  const DVec3 vector = axis / sine * std::sin(half);
  return {std::cos(half), vector.x, vector.y, vector.z};
}

DVec3 Path::Screw::operator()(DVec3 point, double part) const {
  return centre + part_of_turn(turn, part) * (point - centre) + part * shift;
}

Path::Screw Path::screw_of(std::span<const Drag> drags, int group) {
  std::vector<DVec3> from, to;
  for (const Drag& drag : drags)
    if (drag.group == group && !drag.anchor) from.push_back(drag.source), to.push_back(drag.target);
  if (from.size() < 2) return {};
  RigidMotion motion = fit_any_turn(from, to);
  for (const Drag& drag : drags)  // handles that turn by themselves say which way round
    if (drag.group == group && drag.turn && glm::dot(*drag.turn, motion.turn) < 0) motion.turn = -motion.turn;
  const double angle = angle_of(motion.turn);
  constexpr double least_turn = 1e-3;  // radians: below, the way is as good as straight, and the axis far away
  if (angle < least_turn) return {};
  const DVec3 axis = glm::normalize(DVec3(motion.turn.x, motion.turn.y, motion.turn.z));
  const DVec3 along = glm::dot(motion.shift, axis) * axis, across = motion.shift - along;
  return {motion.centre + 0.5 * (across + glm::cross(axis, across) / std::tan(angle / 2)), motion.turn, along};
}

Path::Path(std::span<const Drag> drags) : drags_(drags.begin(), drags.end()) {
  for (const Drag& drag : drags_) screw_.push_back(screw_of(drags_, drag.group));
}

DVec3 Path::position(std::size_t i, double part) const {
  const Drag& drag = drags_[i];
  if (drag.anchor || part <= 0) return drag.source;
  if (part >= 1) return drag.target;  // the sums below may differ from it in the last bit
  const DVec3 missed = drag.target - screw_[i](drag.source, 1);
  return screw_[i](drag.source, part) + part * missed;
}

std::optional<DQuat> Path::turn(std::size_t i, double part) const {
  if (!drags_[i].turn) return std::nullopt;
  return part_of_turn(*drags_[i].turn, part);
}

double Path::scale(std::size_t i, double part) const { return std::pow(drags_[i].scale, part); }

double Path::farthest_turn() const {
  double farthest = 0;
  for (std::size_t i = 0; i < drags_.size(); ++i) {
    farthest = std::max(farthest, angle_of(screw_[i].turn));
    if (drags_[i].turn) farthest = std::max(farthest, angle_of(*drags_[i].turn));
  }
  return farthest;
}

}  // namespace engine::deform
