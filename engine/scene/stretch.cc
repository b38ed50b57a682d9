#include "engine/scene/stretch.h"

#include <algorithm>
#include <cmath>

#include "engine/core/svd.h"

namespace engine::scene {

void stretch(GaussianCloud& cloud, std::size_t row, const DMat3& map) {
  DMat3 axes = glm::mat3_cast(glm::normalize(DQuat(cloud.rotation.get(row))));
  const DVec3 log_scale(cloud.log_scale.get(row));
  // Relative to the largest extent, so that squares of extents far from 1 stay within doubles.
  const double unit = std::max({log_scale.x, log_scale.y, log_scale.z});
  for (int axis = 0; axis < 3; ++axis) axes[axis] *= std::exp(log_scale[axis] - unit);
  const Svd drawn = decompose(map * axes);
  DVec3 drawn_log;
  for (int axis = 0; axis < 3; ++axis) {
    const double length = std::max(std::abs(drawn.s[axis]), 1e-30);  // a flat disc has no logarithm across
    drawn_log[axis] = unit + std::log(length);
  }
  cloud.rotation.set(row, Quat(glm::quat_cast(drawn.u)));
  cloud.log_scale.set(row, Vec3(drawn_log));
}

}  // namespace engine::scene
