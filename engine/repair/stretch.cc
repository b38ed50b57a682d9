#include "engine/repair/stretch.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/svd.h"
#include "engine/neighbours/point_index.h"
#include "engine/scene/stretch.h"

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
      scene::stretch(working.gaussians(), row, stretch);
      changed[k] = 1;
    }
  });
  return std::size_t(std::count(changed.begin(), changed.end(), 1));
}

}  // namespace engine::repair
