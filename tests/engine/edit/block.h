// A block on a floor, or above it: a scene with a place that nobody has seen.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include "engine/core/rng.h"
#include "engine/edit/request.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/sh.h"

namespace engine::edit {

/// Appends an upright Gaussian of one colour from all sides; bytes of `extra` count its row.
inline void add_gaussian(scene::GaussianCloud& cloud, Vec3 mean, Vec3 sigma, float opacity_logit, Vec3 color) {
  const std::size_t row = cloud.size();
  cloud.resize(row + 1);
  cloud.mean.set(row, mean);
  cloud.log_scale.set(row, {std::log(sigma.x), std::log(sigma.y), std::log(sigma.z)});
  cloud.rotation.set(row, {1, 0, 0, 0});
  cloud.opacity_logit[row] = opacity_logit;
  for (int c = 0; c < 3; ++c)
    cloud.sh_row(row)[std::size_t(c) * scene::sh_coefficients(cloud.sh_degree)] =
        (color[c] - 0.5f) / float(scene::sh_c0);
  for (std::size_t i = 0; i < cloud.extra_stride; ++i)
    cloud.extra[row * cloud.extra_stride + i] = std::byte(row >> 8 * i & 0xff);
}

constexpr Vec3 block_color{0.9f, 0.1f, 0.1f};
constexpr Vec3 floor_color{0.3f, 0.5f, 0.7f};
constexpr float block_side = 0.5f;

/// The floor is y = 0, seen from above (y down), with nothing where the block stands. The block's bottom is at
/// y = -gap; with a gap, the floor goes on below it.
struct BlockScene {
  scene::GaussianCloud cloud;
  std::size_t floor_rows = 0;  ///< They come first.
  std::vector<scene::Camera> cameras;
  Request request;  ///< Moves the block by 0.9 to the right.
  DVec3 middle{0.0};

  explicit BlockScene(float gap = 0, Mode mode = Mode::move) : middle(0, -0.5 * double(block_side) - double(gap), 0) {
    cloud.sh_degree = 1;
    cloud.extra_stride = 2;
    constexpr float spacing = 0.075f, hole = 0.2f;
    for (int i = -20; i <= 20; ++i)
      for (int k = -20; k <= 20; ++k) {
        const float x = spacing * float(i), z = spacing * float(k);
        if (gap == 0 && std::abs(x) < hole && std::abs(z) < hole) continue;
        add_gaussian(cloud, {x, 0, z}, {0.05f, 0.005f, 0.05f}, 4, floor_color);
      }
    floor_rows = cloud.size();
    constexpr int rows = 8;
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < rows; ++j)
        for (int k = 0; k < rows; ++k) {
          const auto at = [](int n) { return (float(n) + 0.5f) / rows * block_side; };
          add_gaussian(cloud, {at(i) - block_side / 2, -gap - at(j), at(k) - block_side / 2}, Vec3(0.035f), 4,
                       block_color);
        }
    for (int i = 0; i < 5; ++i) {
      const double angle = (double(i) / 4 - 0.5) * std::numbers::pi / 2;
      const DVec3 eye = 2.5 * DVec3(std::sin(angle), -1, -std::cos(angle));
      cameras.push_back(scene::look_at(eye, DVec3(0.3, -0.1, 0), DVec3(0, -1, 0), 0.8, 64, 64));
      cameras.back().name = "view_" + std::to_string(i);
    }
    request.mode = mode;
    request.handles = {{middle, middle + DVec3(0.9, 0, 0), 0.6, 0}};
    request.region = Region{middle - DVec3(0, 0.02, 0), DVec3(double(block_side) + 0.02)};  // nothing of the floor
    request.params.intervals = 1;
    request.params.max_image_side = 64;
    request.params.iterations = 10;
  }
  /// Does the block, which its Gaussians and the pixels blur, hide this point of the floor from every camera?
  [[nodiscard]] bool hides(DVec3 point) const {
    const DVec3 half(0.5 * double(block_side) + 0.12);
    return std::all_of(cameras.begin(), cameras.end(), [&](const scene::Camera& camera) {
      const DVec3 way = camera.centre() - point;
      double enters = 0, leaves = 1;  // of the way, within the slabs of all axes
      for (int axis = 0; axis < 3; ++axis) {
        const double a = (middle[axis] - half[axis] - point[axis]) / way[axis];
        const double b = (middle[axis] + half[axis] - point[axis]) / way[axis];
        enters = std::max(enters, std::min(a, b)), leaves = std::min(leaves, std::max(a, b));
      }
      return enters < leaves;
    });
  }
  /// Positions on the floor where the block stands, clear of what is around it.
  [[nodiscard]] static std::vector<DVec3> below_block() {
    std::vector<DVec3> points;
    for (int i = -4; i <= 4; ++i)
      for (int k = -4; k <= 4; ++k) points.push_back({0.025 * i, 0, 0.025 * k});
    return points;
  }
};

/// Nothing but the block: behind it is a void.
inline BlockScene without_floor() {
  BlockScene block;
  std::vector<std::uint8_t> keep(block.cloud.size(), 1);
  std::fill_n(keep.begin(), block.floor_rows, std::uint8_t(0));
  block.cloud = scene::select(block.cloud, keep);
  block.floor_rows = 0;
  return block;
}

/// The block before what lies far off at all depths, seen by one camera: nobody could tell what goes on behind it.
inline BlockScene before_rubble() {
  BlockScene block = without_floor();
  block.cameras.resize(1);
  const scene::Camera& camera = block.cameras[0];
  Rng rng(0);
  for (int i = -22; i <= 22; ++i)
    for (int k = -22; k <= 22; ++k) {
      const double z = double(rng.uniform(5, 9));
      const DVec2 pixel = DVec2(32.0) + 2.0 * DVec2(i, k);
      const DVec3 at =
          camera.world_from_cam(z * DVec3((pixel.x - camera.cx) / camera.fx, (pixel.y - camera.cy) / camera.fy, 1));
      if (!block.hides(at)) add_gaussian(block.cloud, Vec3(at), Vec3(0.02f * float(z)), 4, floor_color);
    }
  return block;
}

}  // namespace engine::edit
