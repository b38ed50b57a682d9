#include "engine/repair/spots.h"

#include <algorithm>
#include <cmath>

namespace engine::repair {

std::array<DVec3, 5> spots_of(const scene::GaussianCloud& scene, std::size_t row) {
  const DVec3 mean(scene.mean.get(row));
  const Vec3 log_scale = scene.log_scale.get(row);
  const Mat3 axes = glm::mat3_cast(glm::normalize(scene.rotation.get(row)));
  int shortest = 0;
  for (int axis = 1; axis < 3; ++axis)
    if (log_scale[axis] < log_scale[shortest]) shortest = axis;
  std::array<DVec3, 5> spots;
  spots.fill(mean);
  std::size_t next = 1;
  for (int axis = 0; axis < 3; ++axis) {
    if (axis == shortest) continue;
    const DVec3 way = DVec3(axes[axis]) * std::exp(double(log_scale[axis]));
    spots[next++] = mean + way, spots[next++] = mean - way;
  }
  return spots;
}

double longest_axis(const scene::GaussianCloud& scene, std::size_t row) {
  const Vec3 log_scale = scene.log_scale.get(row);
  return std::exp(double(std::max({log_scale.x, log_scale.y, log_scale.z})));
}

}  // namespace engine::repair
