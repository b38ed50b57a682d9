#include "engine/deform/motion.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <optional>

namespace engine::deform {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Distances enter the formulas squared.
constexpr double coincident_squared = coincident * coincident;

// How far beyond handle K + 1 a handle still counts, as a factor on its distance (Interpolation::smooth). Towards 1 the
// weights get steep where three handles are equally far; towards infinity every handle counts everywhere.
constexpr double reach = 1.5;

const DQuat identity{1.0, 0.0, 0.0, 0.0};

double squared_length(DVec3 v) { return glm::dot(v, v); }

bool is_identity(const DQuat& q) { return q.w == 1 && q.x == 0 && q.y == 0 && q.z == 0; }

/// glm::normalize multiplies by 1 / length, which does not always bring (w, 0, 0, 0) to exactly 1; dividing does.
DQuat divided(const DQuat& q, double by) { return {q.w / by, q.x / by, q.y / by, q.z / by}; }

DQuat half_turn_about_normal_of(DVec3 unit) {
  const DVec3 size = glm::abs(unit);
  DVec3 axis{0.0};
  if (size.x <= size.y && size.x <= size.z)
    axis.x = 1;
  else if (size.y <= size.z)
    axis.y = 1;
  else
    axis.z = 1;
  const DVec3 normal = glm::cross(unit, axis);  // at least sqrt(2/3) long
  const DVec3 n = normal / std::sqrt(squared_length(normal));
  return {0.0, n.x, n.y, n.z};
}

/// Normalised weighted sum that is fed one quaternion at a time, each brought to the hemisphere of a reference: the one
/// given, or else the first quaternion.
class Blend {
 public:
  Blend() = default;
  explicit Blend(const DQuat& reference) : reference_(reference) {}

  void add(const DQuat& q, double weight) {
    if (!reference_) reference_ = q;
    const double sign = glm::dot(*reference_, q) < 0 ? -weight : weight;
    sum_ = {sum_.w + sign * q.w, sum_.x + sign * q.x, sum_.y + sign * q.y, sum_.z + sign * q.z};
  }
  [[nodiscard]] DQuat result() const {
    const double length = std::sqrt(glm::dot(sum_, sum_));
    return length < 1e-12 ? identity : divided(sum_, length);  // nothing left: no direction to normalise
  }

 private:
  std::optional<DQuat> reference_;
  DQuat sum_{0.0, 0.0, 0.0, 0.0};
};

/// The K + 1 smallest squared distances to handles of `group`, ascending; infinity where the group is smaller.
std::array<double, neighbours + 1> smallest_squared_distances(DVec3 point, std::span<const HandleMotion> handles,
                                                              int group) {
  std::array<double, neighbours + 1> smallest;
  smallest.fill(infinity);
  for (const HandleMotion& handle : handles) {
    if (handle.group != group) continue;
    double distance = squared_length(handle.source - point);
    for (double& slot : smallest)
      if (distance < slot) std::swap(distance, slot);
  }
  return smallest;
}

/// Calls visit(handle, w) with the unnormalised weights of Interpolation::smooth, where they are not zero. Returns
/// their sum, which is above zero.
template <class Visit>
double visit_smooth_weights(DVec3 point, std::span<const HandleMotion> handles, int group, Visit&& visit) {
  const auto smallest = smallest_squared_distances(point, handles, group);
  const double nearest = smallest.front();
  const double radius = reach * std::sqrt(smallest.back());
  double sum = 0;
  for (const HandleMotion& handle : handles) {
    if (handle.group != group) continue;
    const double squared = squared_length(handle.source - point);
    double weight = 0;
    if (nearest < coincident_squared)  // on a handle, where the weight is infinite: those handles share it
      weight = squared < coincident_squared ? 1 : 0;
    else if (radius == infinity)  // no handle K + 1; relative to the nearest, so that no distance over- or underflows
      weight = nearest / squared;
    else {
      const double distance = std::sqrt(squared), fade = std::max(0.0, 1 - distance / radius);
      weight = nearest / squared * fade * fade;
    }
    if (weight == 0) continue;
    sum += weight;
    visit(handle, weight);
  }
  return sum;
}

}  // namespace

Nearby nearby(DVec3 point, std::span<const HandleMotion> handles, int group, int self) {
  Nearby found;
  std::array<double, neighbours> squared;
  squared.fill(infinity);
  for (std::size_t k = 0; k < handles.size(); ++k) {
    if (handles[k].group != group || int(k) == self) continue;
    const double distance = squared_length(handles[k].source - point);
    std::size_t slot = neighbours;  // insertion sort; an equal distance that came first stays in front
    for (; slot > 0 && distance < squared[slot - 1]; --slot) {
      if (slot == neighbours) continue;
      squared[slot] = squared[slot - 1];
      found.handle[slot] = found.handle[slot - 1];
    }
    if (slot == neighbours) continue;
    squared[slot] = distance;
    found.handle[slot] = int(k);
  }
  const auto count = std::size_t(std::count_if(found.handle.begin(), found.handle.end(), [](int k) { return k >= 0; }));
  double sum = 0;
  for (std::size_t slot = 0; slot < count; ++slot) sum += squared[slot];
  for (std::size_t slot = 0; slot < count; ++slot) {
    if (count == 1)
      found.weight[slot] = 1;  // 1 - d^2 / d^2 would leave the only handle without a say
    else if (sum < coincident_squared)
      found.weight[slot] = 1.0 / double(count);
    else
      found.weight[slot] = (1 - squared[slot] / sum) / double(count - 1);
  }
  return found;
}

DQuat pair_rotation(DVec3 from, DVec3 to, Rotation rotation) {
  const double from_length = std::sqrt(squared_length(from)), to_length = std::sqrt(squared_length(to));
  if (rotation == Rotation::none || from_length < coincident || to_length < coincident) return identity;
  const DVec3 v_h = from / from_length, v_t = to / to_length;
  const DVec3 r = glm::cross(v_h, v_t);
  const double s = glm::dot(v_h, v_t);
  if (rotation == Rotation::paper) {
    const double sign = s < 0 ? -1 : 1;
    return {sign * s, sign * r.x, sign * r.y, sign * r.z};
  }
  if (1 + s < 1e-10) return half_turn_about_normal_of(v_h);  // r is rounding noise: it no longer names an axis
  const DQuat q{1 + s, r.x, r.y, r.z};
  return divided(q, std::sqrt(glm::dot(q, q)));
}

std::vector<HandleMotion> handle_motions(std::span<const Drag> drags, Rotation rotation) {
  std::vector<HandleMotion> motions(drags.size());
  const auto target = [&](std::size_t i) { return drags[i].anchor ? drags[i].source : drags[i].target; };
  for (std::size_t i = 0; i < drags.size(); ++i) {
    motions[i].source = drags[i].source;
    motions[i].translation = target(i) - drags[i].source;
    motions[i].group = drags[i].group;
  }
  for (std::size_t i = 0; i < drags.size(); ++i) {
    if (drags[i].anchor) continue;
    const Nearby near = nearby(drags[i].source, motions, drags[i].group, int(i));
    Blend turn;
    for (std::size_t slot = 0; slot < neighbours; ++slot) {
      if (near.handle[slot] < 0) continue;
      const auto k = std::size_t(near.handle[slot]);
      turn.add(pair_rotation(drags[k].source - drags[i].source, target(k) - target(i), rotation), near.weight[slot]);
    }
    motions[i].rotation = turn.result();
  }
  return motions;
}

GaussianMotion gaussian_motion(DVec3 mean, std::span<const HandleMotion> handles, int group,
                               Interpolation interpolation) {
  DVec3 shift{0.0};
  // As a Gaussian moves, another handle becomes the first one; a fixed reference keeps the sum continuous.
  Blend turn = interpolation == Interpolation::paper ? Blend() : Blend(identity);
  const auto add = [&](const HandleMotion& handle, double weight) {
    if (weight == 0) return;  // also keeps a handle without a say from choosing the hemisphere
    shift += weight * handle.translation;
    // target + R (mean - source) is mean + dp + (R - 1) (mean - source): written so, no motion comes out as exactly
    // none.
    if (interpolation == Interpolation::rigid && !is_identity(handle.rotation)) {
      const DVec3 arm = mean - handle.source;
      shift += weight * (handle.rotation * arm - arm);
    }
    turn.add(handle.rotation, weight);
  };

  if (interpolation == Interpolation::paper) {
    const Nearby near = nearby(mean, handles, group);
    assert(near.handle[0] >= 0);
    for (std::size_t slot = 0; slot < neighbours; ++slot)
      if (near.handle[slot] >= 0) add(handles[std::size_t(near.handle[slot])], near.weight[slot]);
  } else {
    const double sum = visit_smooth_weights(mean, handles, group, add);
    assert(sum > 0);
    shift /= sum;
  }
  return {mean + shift, turn.result()};
}

}  // namespace engine::deform
