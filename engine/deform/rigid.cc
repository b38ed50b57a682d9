#include "engine/deform/rigid.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>
#include <vector>

#include "engine/core/svd.h"

namespace engine::deform {
namespace {

constexpr double one_piece = 0.01;  // of the longest way; who places handles by hand is not more exact

/// Sum of to from^T, each from its middle.
DMat3 cross_covariance(std::span<const DVec3> from, DVec3 from_middle, std::span<const DVec3> to, DVec3 to_middle) {
  DMat3 sum(0.0);
  for (std::size_t i = 0; i < from.size(); ++i) sum += glm::outerProduct(to[i] - to_middle, from[i] - from_middle);
  return sum;
}

double largest_entry(const Matrix4& n) {
  double largest = 0;
  for (const auto& row : n)
    for (const double value : row) largest = std::max(largest, std::abs(value));
  return largest;
}

/// Projection of the identity onto the eigenvectors of the largest eigenvalue, of any length: of the best turns, the
/// least. The shorter it is the nearer to a half-turn. Found by squaring: eigenvalues whose relative difference is
/// below 2^-squarings are one.
DQuat least_of_best_turns(Matrix4 n, int squarings) {
  const double size = 4 * largest_entry(n);
  for (std::size_t a = 0; a < 4; ++a) n[a][a] += size;  // no eigenvalue is negative now
  for (int k = 0; k < squarings; ++k) {
    Matrix4 squared{};
    for (std::size_t a = 0; a < 4; ++a)
      for (std::size_t b = 0; b < 4; ++b)
        for (std::size_t c = 0; c < 4; ++c) squared[a][b] += n[a][c] * n[c][b];
    const double largest = largest_entry(squared);
    for (auto& row : squared)
      for (double& value : row) value /= largest;
    n = squared;
  }
  const double trace = n[0][0] + n[1][1] + n[2][2] + n[3][3];
  return DQuat(n[0][0], n[1][0], n[2][0], n[3][0]) / trace;
}

/// So many that turns are told apart by what they make of the points, if that is more than the slack.
///   spread  sum of squared distances from the middle
int squarings_for(double spread, std::size_t points, double slack) {
  constexpr double most = 40;  // 1e-12: beyond, rounding decides
  const double told_apart = double(points) * slack * slack;
  if (!(told_apart > 0)) return int(most);
  return int(std::clamp(std::ceil(std::log2(spread / told_apart)), 0.0, most));
}

std::vector<int> groups_of(std::span<const Drag> drags) {
  std::vector<int> groups;
  for (const Drag& drag : drags) groups.push_back(drag.group);
  std::sort(groups.begin(), groups.end());
  groups.erase(std::unique(groups.begin(), groups.end()), groups.end());
  return groups;
}

/// How the group moves, if it does so as one piece.
std::optional<RigidMotion> motion_of_piece(std::span<const Drag> drags, int group) {
  // Handles that all stay, or go no farther than coordinates are exact, are one piece too.
  constexpr double rounding = 1e-12;
  const Places places = places_of(drags, group);
  const double slack = one_piece * places.longest;
  const RigidMotion motion = fit_rigid(places.from, places.to, slack);
  if (motion.residual <= slack + rounding * places.extent) return motion;
  return std::nullopt;
}

double farthest_off(const RigidMotion& motion, std::span<const DVec3> from, std::span<const DVec3> to) {
  double farthest = 0;
  for (std::size_t i = 0; i < from.size(); ++i) farthest = std::max(farthest, glm::distance(motion(from[i]), to[i]));
  return farthest;
}

}  // namespace

Places places_of(std::span<const Drag> drags, int group) {
  Places out;
  for (const Drag& drag : drags) {
    if (drag.group != group) continue;
    out.from.push_back(drag.source), out.to.push_back(drag.anchor ? drag.source : drag.target);
    out.longest = std::max(out.longest, glm::distance(out.from.back(), out.to.back()));
    out.extent = std::max({out.extent, glm::length(out.from.back()), glm::length(out.to.back())});
    out.anchors += drag.anchor;
  }
  return out;
}

RigidMotion fit_rigid(std::span<const DVec3> from, std::span<const DVec3> to, double slack) {
  assert(from.size() == to.size());
  RigidMotion motion;
  if (from.empty()) return motion;
  DVec3 after(0.0);
  for (std::size_t i = 0; i < from.size(); ++i)
    motion.centre += from[i] / double(from.size()), after += to[i] / double(from.size());
  motion.shift = after - motion.centre;
  double spread_from = 0, spread_to = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    spread_from += glm::dot(from[i] - motion.centre, from[i] - motion.centre);
    spread_to += glm::dot(to[i] - after, to[i] - after);
  }
  const int squarings = squarings_for(std::sqrt(spread_from * spread_to), from.size(), slack);
  if (const Matrix4 n = horn_matrix(cross_covariance(from, motion.centre, to, after)); largest_entry(n) > 0) {
    const DQuat turn = least_of_best_turns(n, squarings);
    const double length = std::sqrt(glm::dot(turn, turn));
    constexpr double half_turn = 1e-6;  // cosine of half the angle: below it the axis is rounding
    constexpr double no_turn = 1e-9;    // sine of it: what only shifts shall not turn by rounding either
    if (length > half_turn && glm::length(DVec3(turn.x, turn.y, turn.z)) > no_turn * length)
      motion.turn = turn / length;
  }
  motion.residual = farthest_off(motion, from, to);
  return motion;
}

bool span_a_plane(std::span<const DVec3> points) {
  if (points.size() < 3) return false;
  const auto farthest_from = [&](auto distance) {
    return *std::ranges::max_element(points, {}, [&](DVec3 point) { return distance(point); });
  };
  const DVec3 a = farthest_from([&](DVec3 p) { return glm::distance(p, points[0]); });
  const DVec3 b = farthest_from([&](DVec3 p) { return glm::distance(p, a); });
  const DVec3 c = farthest_from([&](DVec3 p) { return glm::length(glm::cross(p - a, b - a)); });
  constexpr double collinear = 0.05;  // height of a triangle over its base: below, noise decides on the plane
  return glm::length(glm::cross(c - a, b - a)) > collinear * glm::dot(b - a, b - a);
}

RigidMotion fit_any_turn(std::span<const DVec3> from, std::span<const DVec3> to) {
  RigidMotion motion = fit_rigid(from, to);
  if (!span_a_plane(from) || motion.turn != DQuat(1, 0, 0, 0)) return motion;
  RigidMotion turned = motion;
  turned.turn = nearest_rotation(cross_covariance(from, motion.centre, to, motion.centre + motion.shift));
  turned.residual = farthest_off(turned, from, to);
  return turned.residual < motion.residual ? turned : motion;
}

RigidMotion fit_similarity(std::span<const DVec3> from, std::span<const DVec3> to) {
  RigidMotion motion = fit_any_turn(from, to);
  const DVec3 after = motion.centre + motion.shift;
  double along = 0, spread = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const DVec3 arm = motion.turn * (from[i] - motion.centre);
    along += glm::dot(to[i] - after, arm), spread += glm::dot(arm, arm);
  }
  if (along > 0 && spread > 0) motion.scale = along / spread;
  motion.residual = farthest_off(motion, from, to);
  return motion;
}

bool moves_as_one_piece(std::span<const Drag> drags, int group) { return motion_of_piece(drags, group).has_value(); }

void turn_whole_groups(std::span<const Drag> drags, std::span<HandleMotion> motions) {
  assert(drags.size() == motions.size());
  for (const int group : groups_of(drags)) {
    const auto motion = motion_of_piece(drags, group);
    if (!motion) continue;
    for (std::size_t i = 0; i < drags.size(); ++i)
      if (drags[i].group == group && !drags[i].anchor) motions[i].rotation = motion->turn;
  }
}

}  // namespace engine::deform
