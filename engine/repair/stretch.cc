#include "engine/repair/stretch.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/neighbours/point_index.h"

namespace engine::repair {
namespace {

// So many neighbours fix the nine numbers of a linear map well, and lie on the same surface.
constexpr std::size_t neighbours_asked = 16;
// A map that is nearer to turning than this leaves the bytes as they are.
constexpr double least_stretch = 1.02;
// Of one interval. A copy that needed more would smear its colour over what lies between.
constexpr double most_stretch = 3;
// Share of the neighbours' squared distances that no linear map explains, from which on a place counts as torn.
constexpr double torn = 0.05;
// The map is pulled towards turning alone by this share of the neighbours' spread: it decides across a surface, where
// neighbours say nothing, and quiets what little they say. Of 0.001 to 0.3, a drag and the one that undoes it leave
// most of the fox's ear at 0.1, and of the made-up bush little less than at 0.01.
constexpr double ridge = 0.1;

/// m = u diag(s) v^T, s descending and not negative but for its last entry; u and v are rotations.
/// Where m is flat, u goes on as a rotation does.
struct Svd {
  DMat3 u, v;
  DVec3 s;
};

/// One-sided Jacobi (Hestenes 1958): turns pairs of columns until all are at right angles.
Svd decompose(DMat3 m) {
  DMat3 v(1.0);
  constexpr int enough = 6;  // sweeps: 3 x 3 settles within as many
  for (int sweep = 0; sweep < enough; ++sweep)
    for (const auto& [p, q] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
      const double angle = 0.5 * std::atan2(2 * glm::dot(m[p], m[q]), glm::dot(m[p], m[p]) - glm::dot(m[q], m[q]));
      const double c = std::cos(angle), s = std::sin(angle);
      for (DMat3* matrix : {&m, &v}) {  // the longer column comes first: the angle is in [-pi/2, pi/2]
        const DVec3 first = c * (*matrix)[p] + s * (*matrix)[q];
        (*matrix)[q] = c * (*matrix)[q] - s * (*matrix)[p];
        (*matrix)[p] = first;
      }
    }
  const auto unit = [](DVec3 a, DVec3 otherwise) {
    const double length = glm::length(a);
    return length > 0 ? a / length : otherwise;
  };
  const DVec3 x = unit(m[0], {1, 0, 0});
  const DVec3 across = std::abs(x.x) < 0.9 ? DVec3(1, 0, 0) : DVec3(0, 1, 0);
  const DVec3 y = unit(m[1] - glm::dot(m[1], x) * x, glm::normalize(across - glm::dot(across, x) * x));
  const DMat3 u(x, y, glm::cross(x, y));
  return {u, v, DVec3(glm::dot(m[0], u[0]), glm::dot(m[1], u[1]), glm::dot(m[2], u[2]))};
}

/// Where a copy's neighbours are from it, before and after the deformation.
struct Surroundings {
  std::array<DVec3, neighbours_asked> before, now;
};

/// S, or the identity.
DMat3 stretch_of(const Surroundings& around) {
  DMat3 turn(0.0);
  for (std::size_t k = 0; k < neighbours_asked; ++k) turn += glm::outerProduct(around.now[k], around.before[k]);
  const Svd turned = decompose(turn);
  const DMat3 rotation = turned.u * glm::transpose(turned.v);  // Kabsch 1976

  DMat3 from(0.0), to(0.0);
  double spread = 0;
  for (std::size_t k = 0; k < neighbours_asked; ++k) {
    const DVec3 unstretched = rotation * around.before[k];
    from += glm::outerProduct(unstretched, unstretched);
    to += glm::outerProduct(around.now[k], unstretched);
    spread += glm::dot(unstretched, unstretched);
  }
  if (!(spread > 0)) return DMat3(1.0);  // all in one place
  for (int axis = 0; axis < 3; ++axis) from[axis][axis] += ridge * spread, to[axis][axis] += ridge * spread;
  const DMat3 map = to * glm::inverse(from);

  double unexplained = 0, distances = 0;
  for (std::size_t k = 0; k < neighbours_asked; ++k) {
    const DVec3 rest = around.now[k] - map * (rotation * around.before[k]);
    unexplained += glm::dot(rest, rest), distances += glm::dot(around.now[k], around.now[k]);
  }
  const Svd drawn = decompose(map);
  const double most = drawn.s[0], least = drawn.s[2];
  const bool is_torn = !(unexplained < torn * distances) || most > most_stretch || least < 1 / most_stretch;
  if (is_torn || (most < least_stretch && least > 1 / least_stretch)) return DMat3(1.0);
  return map;
}

void stretch_row(scene::GaussianCloud& cloud, std::size_t row, const DMat3& stretch) {
  DMat3 axes = glm::mat3_cast(glm::normalize(DQuat(cloud.rotation.get(row))));
  const DVec3 log_scale(cloud.log_scale.get(row));
  // Relative to the largest extent, so that squares of extents far from 1 stay within doubles.
  const double unit = std::max({log_scale.x, log_scale.y, log_scale.z});
  for (int axis = 0; axis < 3; ++axis) axes[axis] *= std::exp(log_scale[axis] - unit);
  const Svd drawn = decompose(stretch * axes);
  DVec3 drawn_log;
  for (int axis = 0; axis < 3; ++axis) {
    const double length = std::max(std::abs(drawn.s[axis]), 1e-30);  // a flat disc has no logarithm across
    drawn_log[axis] = unit + std::log(length);
  }
  cloud.rotation.set(row, Quat(glm::quat_cast(drawn.u)));
  cloud.log_scale.set(row, Vec3(drawn_log));
}

}  // namespace

std::size_t draw_out(WorkingScene& working) {
  const std::vector<std::uint32_t> copies = working.rows_of(working::Role::copy);
  const std::vector<float> points = interleaved(working.mean_at_deform(), copies);
  const std::size_t asked = neighbours_asked + 1;  // the nearest is the copy itself
  if (copies.size() < asked) return 0;
  const auto nearest = neighbours::PointIndex(points, 3).nearest(points, asked);
  std::vector<std::uint8_t> changed(copies.size(), 0);
  constexpr std::size_t grain = 256;
  parallel_for(copies.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const std::uint32_t row = copies[k];
      Surroundings around;
      for (std::size_t n = 0; n < neighbours_asked; ++n) {
        const std::uint32_t other = copies[nearest[k * asked + n + 1].index];
        around.before[n] = DVec3(working.mean_at_deform().get(other)) - DVec3(working.mean_at_deform().get(row));
        around.now[n] = DVec3(working.cloud().mean.get(other)) - DVec3(working.cloud().mean.get(row));
      }
      const DMat3 stretch = stretch_of(around);
      if (stretch == DMat3(1.0)) continue;
      stretch_row(working.gaussians(), row, stretch);
      changed[k] = 1;
    }
  });
  return std::size_t(std::count(changed.begin(), changed.end(), 1));
}

}  // namespace engine::repair
