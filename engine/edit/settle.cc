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

/// A part with its handles, and what it stands on.
class Part {
 public:
  Part(bool scales, const std::function<std::optional<select::Footings>(const deform::RigidMotion&)>& stand)
      : scales_(scales), stand_(stand) {}

  /// As upright on its floor as before, turned about the middle of its handles, which is what they say best. Nothing
  /// where it is on two planes, as on a crown: nobody knows their normals better than handles do.
  [[nodiscard]] std::optional<Drags> righted(Drags drags) const {
    const bool may_tilt =
        drags.size() > 1 && std::ranges::none_of(drags, [](const auto& drag) { return drag.turn.has_value(); });
    const deform::RigidMotion motion = motion_of(drags);
    const auto footings = may_tilt ? stand_(motion) : std::nullopt;
    if (!footings || footings->before.normal != footings->after.normal) return std::nullopt;
    const DVec3 up = footings->after.normal, leans = motion.turn * up;
    if (glm::dot(leans, up) < upright) return std::nullopt;
    deform::RigidMotion righted = motion;
    righted.turn = deform::pair_rotation(leans, up, deform::Rotation::shortest_arc) * motion.turn;
    for (deform::Drag& drag : drags) drag.target = righted(drag.source);
    return drags;
  }
  /// As high as before.
  [[nodiscard]] std::optional<Drags> set_down(Drags drags) const {
    const deform::RigidMotion motion = motion_of(drags);
    const auto footings = stand_(motion);
    if (!footings) return std::nullopt;
    const double rise = motion.scale * footings->before.height - footings->after.height;
    for (deform::Drag& drag : drags) drag.target += rise * footings->after.normal;
    return drags;
  }

 private:
  [[nodiscard]] deform::RigidMotion motion_of(const Drags& drags) const {
    return deform::nearest_motion(drags, drags.front().group, scales_);
  }

  bool scales_;
  const std::function<std::optional<select::Footings>(const deform::RigidMotion&)>& stand_;
};

}  // namespace

std::optional<std::vector<DVec3>> settled(
    std::span<const deform::Drag> drags, bool scales,
    const std::function<std::optional<select::Footings>(const deform::RigidMotion&)>& stand) {
  double way = 0;
  for (const deform::Drag& drag : drags) way = std::max(way, glm::distance(drag.source, drag.target));
  if (!(way > 0) || std::ranges::any_of(drags, &deform::Drag::anchor)) return std::nullopt;

  const Part part(scales, stand);
  const Drags asked(drags.begin(), drags.end());
  const auto is_slip = [&](const std::optional<Drags>& put) { return put && correction(*put, asked) <= most * way; };
  std::optional<Drags> put = part.righted(asked);
  if (put) put = part.set_down(*put);
  if (!is_slip(put)) put = part.set_down(asked);
  if (!is_slip(put) || correction(*put, asked) < least * way) return std::nullopt;
  std::vector<DVec3> targets;
  for (const deform::Drag& drag : *put) targets.push_back(drag.target);
  return targets;
}

}  // namespace engine::edit
