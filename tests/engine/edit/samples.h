// Small scenes for the tests of this room.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <string>
#include <vector>

#include "engine/core/rng.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/overlay.h"

namespace engine::edit {

/// A wall of dim Gaussians in the plane z = 2 and a bright ball of `ball` Gaussians with radius 0.2 around `center`.
/// Rows of wall and ball alternate, so that "survivors in input order" is not trivially true.
inline scene::GaussianCloud ball_before_wall(std::size_t ball, Vec3 center = Vec3(0), int degree = 2) {
  scene::GaussianCloud cloud;
  cloud.sh_degree = degree;
  cloud.extra_stride = 5;
  constexpr std::size_t wall_side = 12;
  const std::size_t wall = wall_side * wall_side;
  cloud.resize(ball + wall);
  Rng rng(77);
  std::size_t balls_made = 0, walls_made = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const bool in_ball = balls_made < ball && (i % 2 == 0 || walls_made == wall);
    Vec3 mean;
    if (in_ball) {
      ++balls_made;
      do mean = {rng.uniform(-0.2f, 0.2f), rng.uniform(-0.2f, 0.2f), rng.uniform(-0.2f, 0.2f)};
      while (glm::length(mean) > 0.19f);
    } else {
      const std::size_t column = walls_made % wall_side, row = walls_made / wall_side;
      mean = {(float(column) / (wall_side - 1) - 0.5f) * 4, (float(row) / (wall_side - 1) - 0.5f) * 4, 2};
      ++walls_made;
    }
    cloud.mean.set(i, mean + center);
    const float log_scale = std::log(in_ball ? 0.06f : 0.25f);
    cloud.log_scale.set(i, {log_scale, log_scale, log_scale + rng.uniform(-0.5f, 0.0f)});
    cloud.rotation.set(i, {rng.normal() + 3, rng.normal(), rng.normal(), rng.normal()});
    cloud.opacity_logit[i] = in_ball ? rng.uniform(-1.0f, 4.0f) : 3.0f;
    for (float& value : cloud.sh_row(i)) value = rng.uniform(-0.5f, 0.5f);
  }
  for (std::byte& value : cloud.extra) value = std::byte(rng.next());
  return cloud;
}

/// `count` cameras on an arc in front of `center`, at distance 3, looking at it; `side` x `side` pixels.
inline std::vector<scene::Camera> arc_of_cameras(int count, int side, DVec3 center = DVec3(0)) {
  std::vector<scene::Camera> cameras;
  for (int i = 0; i < count; ++i) {
    const double angle = (count == 1 ? 0.0 : double(i) / (count - 1) - 0.5) * std::numbers::pi / 2;
    const DVec3 eye = center + 3.0 * DVec3(std::sin(angle), 0, -std::cos(angle));
    cameras.push_back(scene::look_at(eye, center, DVec3(0, -1, 0), 0.9, side, side));
    cameras.back().name = "view_" + std::to_string(i);
  }
  return cameras;
}

/// The input rows that an overlay leaves, ascending: row i of flatten() is survivors[i] of the input.
inline std::vector<std::uint32_t> survivors_of(std::size_t input_rows, const scene::Overlay& overlay) {
  std::vector<std::uint32_t> survivors;
  for (std::uint32_t row = 0; row < input_rows; ++row)
    if (!std::binary_search(overlay.removed.begin(), overlay.removed.end(), row)) survivors.push_back(row);
  return survivors;
}

/// Row a of `left` and row b of `right` hold the same bytes.
inline bool same_row(const scene::GaussianCloud& left, std::size_t a, const scene::GaussianCloud& right,
                     std::size_t b) {
  const auto same = [](float x, float y) { return std::bit_cast<std::uint32_t>(x) == std::bit_cast<std::uint32_t>(y); };
  return same(left.mean.x[a], right.mean.x[b]) && same(left.mean.y[a], right.mean.y[b]) &&
         same(left.mean.z[a], right.mean.z[b]) && same(left.log_scale.x[a], right.log_scale.x[b]) &&
         same(left.log_scale.y[a], right.log_scale.y[b]) && same(left.log_scale.z[a], right.log_scale.z[b]) &&
         same(left.rotation.w[a], right.rotation.w[b]) && same(left.rotation.x[a], right.rotation.x[b]) &&
         same(left.rotation.y[a], right.rotation.y[b]) && same(left.rotation.z[a], right.rotation.z[b]) &&
         same(left.opacity_logit[a], right.opacity_logit[b]) &&
         std::memcmp(left.sh_row(a).data(), right.sh_row(b).data(), left.sh_stride() * sizeof(float)) == 0 &&
         std::memcmp(left.extra_row(a).data(), right.extra_row(b).data(), left.extra_stride) == 0;
}

}  // namespace engine::edit
