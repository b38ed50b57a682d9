// The block on a floor that is darker beside it.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <numeric>
#include <vector>

#include "engine/repair/shadow.h"
#include "engine/scene/base_color.h"
#include "tests/engine/edit/block.h"

namespace engine::repair {

/// So much of the light comes to a place of the floor, by x and z.
using LightOnFloor = std::function<float(float x, float z)>;

/// A shadow to the right of the block, from its side on.
inline float beside_block(float x, float z) { return x > 0 && x < 0.6f && std::abs(z) < 0.3f ? 0.6f : 1.0f; }

struct ShadowedBlock {
  edit::BlockScene block;
  std::vector<std::uint32_t> part;  ///< Rows of the block.

  explicit ShadowedBlock(const LightOnFloor& light) {
    for (std::uint32_t row = 0; row < block.floor_rows; ++row) {
      const Vec3 mean = block.cloud.mean.get(row);
      const Vec3 color = light(mean.x, mean.z) * scene::base_color(block.cloud, row);
      const std::size_t stride = scene::sh_coefficients(block.cloud.sh_degree);
      for (int c = 0; c < 3; ++c)
        block.cloud.sh_row(row)[std::size_t(c) * stride] = (color[c] - 0.5f) / float(scene::sh_c0);
    }
    block.request.params.max_image_side = 160;
    part.resize(block.cloud.size() - block.floor_rows);
    std::iota(part.begin(), part.end(), std::uint32_t(block.floor_rows));
    for (scene::Camera& camera : block.cameras)
      camera = scene::look_at(camera.centre(), {0, 0, 0}, {0, -1, 0}, 0.9, 160, 160);
  }
  /// Everything so many times as large, and moved.
  ShadowedBlock& placed(double scale, DVec3 shift) {
    for (std::size_t row = 0; row < block.cloud.size(); ++row) {
      block.cloud.mean.set(row, Vec3(scale * DVec3(block.cloud.mean.get(row)) + shift));
      block.cloud.log_scale.set(row, block.cloud.log_scale.get(row) + float(std::log(scale)));
    }
    for (scene::Camera& camera : block.cameras)
      camera.translation = -(camera.rotation * (scale * camera.centre() + shift));
    return *this;
  }
  [[nodiscard]] Shadow shadow() const {
    return Shadow(look_around(block.cloud, part, block.cameras, [](double) { return Result<void>(); }).value());
  }
};

}  // namespace engine::repair
