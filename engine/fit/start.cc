#include "engine/fit/start.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "engine/core/median.h"
#include "engine/neighbours/point_index.h"
#include "engine/scene/opacity.h"
#include "engine/scene/sh.h"

namespace engine::fit {
namespace {

// Both as in the program published with Kerbl et al. 2023.
constexpr double first_opacity = 0.1;
constexpr std::size_t neighbours_for_size = 3;
// Factors of the median that sizes stay within: log(0) is no size, and a lone point's splat would hide the whole scene.
// Both are choices.
constexpr float smallest_part = 1e-4f, largest_part = 30.0f;

/// [n] root mean square distance to the nearest other points.
std::vector<float> spacing(std::span<const float> positions) {
  const std::size_t n = positions.size() / 3;
  const neighbours::PointIndex index(positions, 3);
  const auto nearest = index.nearest(positions, neighbours_for_size + 1);  // each point finds itself, too
  const std::size_t found = n == 0 ? 0 : nearest.size() / n;
  std::vector<float> distance(n, 0.0f);
  for (std::size_t i = 0; i < n; ++i) {
    double sum = 0;
    for (std::size_t k = 0; k < found; ++k) sum += double(nearest[i * found + k].squared_distance);
    distance[i] = found > 1 ? float(std::sqrt(sum / double(found - 1))) : 0.0f;
  }
  return distance;
}

DVec3 median_position(std::span<const ColoredPoint> points) {
  DVec3 middle(0.0);
  std::vector<double> along(points.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < points.size(); ++i) along[i] = points[i].position[axis];
    middle[axis] = median(along);
  }
  return middle;
}

}  // namespace

scene::GaussianCloud gaussians_at(std::span<const ColoredPoint> points, int sh_degree) {
  scene::GaussianCloud cloud;
  cloud.sh_degree = sh_degree;
  cloud.resize(points.size());
  if (points.empty()) return cloud;
  // Relative to the middle: float would not keep small distances apart far from the origin. A median, which a point
  // that lies lost far away does not carry off.
  const DVec3 middle = median_position(points);
  std::vector<float> positions;
  for (const ColoredPoint& point : points)
    for (int axis = 0; axis < 3; ++axis) positions.push_back(float(point.position[axis] - middle[axis]));
  const std::vector<float> distance = spacing(positions);
  const float typical = std::max(median(distance), 1e-7f);  // all points in one place: some size that is not 0

  const std::size_t coefficients = scene::sh_coefficients(sh_degree);
  for (std::size_t i = 0; i < points.size(); ++i) {
    cloud.mean.set(i, Vec3(points[i].position));
    cloud.log_scale.set(i, Vec3(std::log(std::clamp(distance[i], smallest_part * typical, largest_part * typical))));
    cloud.rotation.set(i, Quat(1, 0, 0, 0));
    cloud.opacity_logit[i] = float(scene::logit(first_opacity));
    for (std::size_t c = 0; c < 3; ++c)
      cloud.sh_row(i)[c * coefficients] = float((double(points[i].rgb[c]) / 255.0 - 0.5) / scene::sh_c0);
  }
  return cloud;
}

scene::GaussianCloud with_sh_degree(const scene::GaussianCloud& cloud, int sh_degree) {
  scene::GaussianCloud out = cloud;
  out.sh_degree = sh_degree;
  out.sh.assign(cloud.size() * out.sh_stride(), 0.0f);
  const std::size_t from = scene::sh_coefficients(cloud.sh_degree), to = scene::sh_coefficients(sh_degree);
  for (std::size_t i = 0; i < 3 * cloud.size(); ++i)
    std::copy_n(cloud.sh.begin() + std::ptrdiff_t(i * from), std::min(from, to),
                out.sh.begin() + std::ptrdiff_t(i * to));
  return out;
}

}  // namespace engine::fit
