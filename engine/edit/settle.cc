#include "engine/edit/settle.h"

#include <algorithm>

namespace engine::edit {
namespace {

constexpr double most = 0.05;   // of the longest way: as near as a motion comes to handles that ask for one (attach.h)
constexpr double least = 1e-3;  // of it

/// The farthest that the motion takes a handle from its target.
double misses(const deform::RigidMotion& motion, std::span<const deform::Drag> drags) {
  double farthest = 0;
  for (const deform::Drag& drag : drags)
    farthest = std::max(farthest, glm::distance(motion(drag.source), drag.anchor ? drag.source : drag.target));
  return farthest;
}

/// How far from where one motion takes the handles another one takes them at most.
double differ(const deform::RigidMotion& a, const deform::RigidMotion& b, std::span<const deform::Drag> drags) {
  double farthest = 0;
  for (const deform::Drag& drag : drags) farthest = std::max(farthest, glm::distance(a(drag.source), b(drag.source)));
  return farthest;
}

/// May its handles have tilted it by mistake?
bool may_be_tilted(std::span<const deform::Drag> drags) {
  return drags.size() > 1 &&
         std::ranges::none_of(drags, [](const deform::Drag& drag) { return drag.turn.has_value(); });
}

}  // namespace

std::optional<deform::RigidMotion> settled(
    const deform::RigidMotion& asked, std::span<const deform::Drag> drags,
    const std::function<std::optional<select::Footings>(const deform::RigidMotion&)>& stand) {
  double way = 0;
  for (const deform::Drag& drag : drags)
    if (!drag.anchor) way = std::max(way, glm::distance(drag.source, drag.target));
  if (!(way > 0)) return std::nullopt;
  const auto is_slip = [&](const deform::RigidMotion& motion) { return misses(motion, drags) <= most * way; };

  deform::RigidMotion motion = asked;
  std::optional<select::Footings> footings = stand(motion);
  // Of two planes, as on a crown, nobody knows the normals better than handles do.
  const bool is_on_one_plane = footings && footings->before.normal == footings->after.normal;
  if (is_on_one_plane && may_be_tilted(drags)) {
    const DVec3 leans = asked.turn * footings->before.normal;
    const DQuat upright = deform::pair_rotation(leans, footings->after.normal, deform::Rotation::shortest_arc);
    deform::RigidMotion turned = asked;  // about the middle of the handles, which is known best
    turned.turn = upright * asked.turn;
    if (is_slip(turned)) motion = turned, footings = stand(motion);  // upright, it has other feet
  }
  if (!footings) return std::nullopt;
  const auto& [before, after] = *footings;
  motion.shift += (motion.scale * before.height - after.height) * after.normal;
  if (!is_slip(motion) || differ(motion, asked, drags) < least * way) return std::nullopt;
  return motion;
}

}  // namespace engine::edit
