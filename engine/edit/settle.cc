#include "engine/edit/settle.h"

#include <algorithm>

#include "engine/deform/attach.h"

namespace engine::edit {
namespace {

constexpr double most = 0.05;   // of the longest way: as near as a motion comes to handles that ask for one (attach.h)
constexpr double least = 1e-3;  // of it
constexpr double upright = 0.985;  // cosine of 10 degrees, which no slip tilts a part by

using Drags = std::vector<deform::Drag>;

/// The farthest that a target is from where it was asked to be.
double correction(const Drags& drags, std::span<const deform::Drag> asked) {
  double farthest = 0;
  for (std::size_t k = 0; k < drags.size(); ++k)
    farthest = std::max(farthest, glm::distance(drags[k].target, asked[k].target));
  return farthest;
}

/// As upright on its floor as before, turned about the middle of its handles, which is what they say best. Nothing
/// where it is on two planes, as on a crown: nobody knows their normals better than handles do.
///   motion    that the drags ask for
///   footings  with it
std::optional<Drags> righted(Drags drags, const deform::RigidMotion& motion, const select::Footings& footings) {
  const bool may_tilt =
      drags.size() > 1 && std::ranges::none_of(drags, [](const auto& drag) { return drag.turn.has_value(); });
  const DVec3 up = footings.after.normal, leans = motion.turn * up;
  if (!may_tilt || footings.before.normal != up || glm::dot(leans, up) < upright) return std::nullopt;
  deform::RigidMotion righted = motion;
  righted.turn = deform::pair_rotation(leans, up, deform::Rotation::shortest_arc) * motion.turn;
  for (deform::Drag& drag : drags) drag.target = righted(drag.source);
  return drags;
}

/// As high as before.
Drags set_down(Drags drags, const deform::RigidMotion& motion, const select::Footings& footings) {
  const double rise = motion.scale * footings.before.height - footings.after.height;
  for (deform::Drag& drag : drags) drag.target += rise * footings.after.normal;
  return drags;
}

}  // namespace

std::optional<std::vector<DVec3>> settled(
    std::span<const deform::Drag> drags, bool scales,
    const std::function<std::optional<select::Footings>(const deform::RigidMotion&)>& stand) {
  double way = 0;
  for (const deform::Drag& drag : drags) way = std::max(way, glm::distance(drag.source, drag.target));
  if (!(way > 0) || std::ranges::any_of(drags, &deform::Drag::anchor)) return std::nullopt;

  const auto motion_of = [&](const Drags& of) { return deform::nearest_motion(of, of.front().group, scales); };
  const Drags asked(drags.begin(), drags.end());
  const deform::RigidMotion motion = motion_of(asked);
  const auto footings = stand(motion);
  if (!footings) return std::nullopt;
  const auto is_slip = [&](const std::optional<Drags>& put) { return put && correction(*put, asked) <= most * way; };
  std::optional<Drags> put = righted(asked, motion, *footings);
  if (put) {
    const deform::RigidMotion upright_motion = motion_of(*put);
    const auto other_feet = stand(upright_motion);
    put = other_feet ? std::optional(set_down(*put, upright_motion, *other_feet)) : std::nullopt;
  }
  if (!is_slip(put)) put = set_down(asked, motion, *footings);
  if (!is_slip(put) || correction(*put, asked) < least * way) return std::nullopt;
  std::vector<DVec3> targets;
  for (const deform::Drag& drag : *put) targets.push_back(drag.target);
  return targets;
}

}  // namespace engine::edit
