#include "engine/repair/vacated.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "engine/mask/mask.h"
#include "engine/neighbours/point_index.h"

namespace engine::repair {
namespace {

// So many neighbours say how densely a place was covered.
constexpr std::size_t neighbours_asked = 8;
// A place is taken if something arrived within so many times the distance that its neighbours had in the mean: between
// the rows of an even surface that is shifted along itself there are at most 0.8.
constexpr double taken_within = 1.5;
// Pixels around its mean in which a row counts as being there: those between neighbouring means of a part, mostly.
constexpr int far_side_px = 2;

}  // namespace

std::vector<std::uint32_t> rows_left_open(const scene::GaussianCloud& original, std::span<const std::uint32_t> left,
                                          std::span<const float> arrived) {
  if (left.empty() || arrived.empty()) return {left.begin(), left.end()};
  const std::vector<float> places = interleaved(original.mean, left);
  const std::size_t asked = std::min(left.size(), neighbours_asked + 1);  // the nearest is the row itself
  const auto beside = neighbours::PointIndex(places, 3).nearest(places, asked);
  std::vector<float> within(left.size());
  for (std::size_t k = 0; k < left.size(); ++k) {
    double spacing = 0;
    for (std::size_t n = 1; n < asked; ++n) spacing += std::sqrt(double(beside[k * asked + n].squared_distance));
    within[k] = float(taken_within * spacing / double(std::max<std::size_t>(asked - 1, 1)));
  }
  const std::vector<std::uint8_t> taken = neighbours::PointIndex(arrived, 3).has_within(places, within);
  std::vector<std::uint32_t> open;
  for (std::size_t k = 0; k < left.size(); ++k)
    if (taken[k] == 0) open.push_back(left[k]);
  return open;
}

scene::Image far_side(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                      const scene::Camera& camera) {
  scene::Image far(camera.width, camera.height, 1);
  for (const std::uint32_t row : rows) {
    const DVec3 p = camera.cam_from_world(cloud.mean.get(row));
    if (!(p.z > 0)) continue;
    const DVec2 pixel = camera.pixel_from_cam(p);
    // Compared as numbers: one far beside the picture has no place that an int could hold.
    if (!(pixel.x > -far_side_px && pixel.y > -far_side_px && pixel.x < camera.width + far_side_px &&
          pixel.y < camera.height + far_side_px))
      continue;
    const int x = int(std::floor(pixel.x)), y = int(std::floor(pixel.y));
    for (int v = std::max(y - far_side_px, 0); v <= std::min(y + far_side_px, camera.height - 1); ++v)
      for (int u = std::max(x - far_side_px, 0); u <= std::min(x + far_side_px, camera.width - 1); ++u)
        far.at(u, v) = std::max(far.at(u, v), float(p.z));
  }
  return far;
}

scene::Mask air(const scene::Mask& empty, const scene::Mask& vacated) {
  assert(empty.data.size() == vacated.data.size());
  const int width = empty.width, height = empty.height;
  // A pixel or two may show nothing for a fault of the scene, and through a crack a hole is no part of what is outside.
  const int crack = mask::blur_radius(height);
  scene::Mask beside = empty;
  for (std::size_t at = 0; at < beside.data.size(); ++at) beside.data[at] &= vacated.data[at] == 0;
  beside = mask::opened(beside, crack);
  scene::Mask wide = mask::opened(empty, crack);
  mask::unite(wide, beside);
  scene::Mask reached(width, height);
  std::vector<std::size_t> next;
  const auto reach = [&](std::size_t at) {
    if (wide.data[at] == 0 || reached.data[at] != 0) return;
    reached.data[at] = 1;
    next.push_back(at);
  };
  for (std::size_t at = 0; at < beside.data.size(); ++at)
    if (beside.data[at] != 0) reach(at);
  while (!next.empty()) {
    const std::size_t at = next.back(), x = at % std::size_t(width), y = at / std::size_t(width);
    next.pop_back();
    if (x > 0) reach(at - 1);
    if (x + 1 < std::size_t(width)) reach(at + 1);
    if (y > 0) reach(at - std::size_t(width));
    if (y + 1 < std::size_t(height)) reach(at + std::size_t(width));
  }
  for (std::size_t at = 0; at < reached.data.size(); ++at)
    reached.data[at] = reached.data[at] != 0 && vacated.data[at] != 0;
  return reached;
}

}  // namespace engine::repair
