#include "engine/fit/start.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "engine/core/median.h"
#include "engine/neighbours/point_index.h"
#include "engine/scene/in_picture.h"
#include "engine/scene/opacity.h"
#include "engine/scene/sh.h"
#include "engine/train/random_streams.h"

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

// Of random_points(), all choices:
constexpr double ball_part = 0.5;            // radius of the ball, as a part of the cameras' distance
constexpr double seeing_part = 1.0 / 3;      // of the cameras that have a point in their pictures
constexpr std::size_t least_seeing = 2;      // cameras; what one sees alone may be at any depth
constexpr std::size_t draws_per_point = 64;  // at most: a volume that is less of the ball is as good as none
constexpr double least_spread = 1e-6;        // of axes: below it rounding alone says where they meet
constexpr double nearest_depth_part = 0.05;  // of the cameras' distance: what is nearer hides the scene behind it
constexpr std::array<std::uint8_t, 3> grey{128, 128, 128};

/// The place whose squared distances from the cameras' axes sum to the least.
Result<DVec3> focus_of(std::span<const scene::Camera> cameras) {
  const auto none = [](const char* what) { return fail(ErrorCode::unprocessable, what, "cameras"); };
  if (cameras.size() < least_seeing) return none("Cameras have a volume in common from two of them on.");
  // Relative to the first camera: coordinates far from the origin would lose digits in the sums.
  const DVec3 origin = cameras.front().centre();
  DMat3 across_all(0.0);
  DVec3 sum(0.0);
  for (const scene::Camera& camera : cameras) {
    const DVec3 axis = camera.ray_direction({camera.cx, camera.cy});
    const DMat3 across = DMat3(1.0) - glm::outerProduct(axis, axis);
    across_all += across;
    sum += across * (camera.centre() - origin);
  }
  // The determinant of the mean is 0 for parallel axes, and grows with the square of the angles between them.
  const double count = double(cameras.size());
  if (!(glm::determinant(across_all / count) > least_spread))
    return none("The cameras look in the same direction: nothing says how far away the scene is.");
  return origin + glm::inverse(across_all) * sum;
}

bool is_in_picture(const scene::Camera& camera, DVec3 point, double nearest_depth) {
  const DVec3 in_cam = camera.cam_from_world(point);
  return in_cam.z >= nearest_depth && scene::pixel_in_picture(camera, in_cam);
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

Result<std::vector<ColoredPoint>> random_points(std::span<const scene::Camera> cameras, std::size_t count,
                                                std::uint64_t seed) {
  assert(count >= 1);
  const auto focus = focus_of(cameras);
  if (!focus) return propagate(focus);
  std::vector<double> distances;
  for (const scene::Camera& camera : cameras) distances.push_back(glm::distance(camera.centre(), *focus));
  const double distance = median(distances), radius = ball_part * distance;
  const std::size_t enough = std::max(least_seeing, std::size_t(std::ceil(seeing_part * double(cameras.size()))));

  std::vector<ColoredPoint> points;
  points.reserve(count);
  Rng rng = train::stream({.seed = seed}, train::Purpose::start, 0);
  for (std::size_t draw = 0; draw < draws_per_point * count && points.size() < count; ++draw) {
    DVec3 local;
    for (int axis = 0; axis < 3; ++axis) local[axis] = double(rng.uniform(-1.0f, 1.0f));
    if (glm::dot(local, local) > 1) continue;  // in the cube, but not in its ball
    const DVec3 place = *focus + radius * local;
    std::size_t seeing = 0;
    for (const scene::Camera& camera : cameras)
      seeing += std::size_t(is_in_picture(camera, place, nearest_depth_part * distance));
    if (seeing >= enough) points.push_back({place, grey});
  }
  if (points.size() < count)
    return fail(ErrorCode::unprocessable,
                "Hardly any place is in the pictures of " + std::to_string(enough) + " of the " +
                    std::to_string(cameras.size()) + " cameras: nothing says where the scene is.",
                "cameras");
  return points;
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
