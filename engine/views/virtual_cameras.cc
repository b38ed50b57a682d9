#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <numeric>

#include "engine/core/parallel.h"
#include "engine/views/views.h"

namespace engine::views {
namespace {

/// A Gaussian as a ray meets it, relative to the centre of the handles.
struct Obstacle {
  DVec3 mean;         ///< World axes, from the centre.
  double reach;       ///< Three sigmas along the longest axis: beyond it the Gaussian is below 1/90 of its peak.
  double opacity;     ///< 0 to 1
  std::uint32_t row;  ///< In the cloud.
};

/// x_in_unit = unit_from_world * (x_in_world - mean): the frame in which the Gaussian is the unit one.
DMat3 unit_from_world(const scene::GaussianCloud& cloud, std::size_t row) {
  DQuat q(cloud.rotation.get(row));
  const double norm = glm::length(q);
  q = norm > 1e-12 ? q / norm : DQuat(1, 0, 0, 0);  // a zero quaternion names no rotation; any is as good
  DMat3 world_from_local = glm::mat3_cast(q);
  for (int axis = 0; axis < 3; ++axis) {
    // Beyond e^+-20 sizes saturate, here as in the renderer: 1 / sigma^2 stays finite.
    const double log_scale = std::clamp(double(cloud.log_scale.get(row)[axis]), -20.0, 20.0);
    world_from_local[axis] *= std::exp(-log_scale);
  }
  return glm::transpose(world_from_local);
}

/// The rows that are looked at: all, or `count` of them, evenly spread.
class Sample {
 public:
  Sample(std::size_t rows, std::size_t most) : rows_(rows), count_(most > 0 ? std::min(rows, most) : rows) {}

  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] std::size_t row(std::size_t i) const { return count_ == rows_ ? i : std::size_t(double(i) * share()); }
  /// How many Gaussians each of them stands for.
  [[nodiscard]] double share() const { return double(rows_) / double(std::max<std::size_t>(count_, 1)); }

 private:
  std::size_t rows_, count_;
};

double sigmoid(double x) { return 1.0 / (1.0 + std::exp(-x)); }

/// What the dome is built around; lengths in world units.
struct Subject {
  DVec3 centre;
  std::vector<DVec3> points;  ///< From the centre; at most 16 of them, which is plenty to judge visibility.
  double points_radius = 0;   ///< Largest distance of a point from the centre.
  double far = 0, near = 0;   ///< Largest and smallest distance of a camera from the centre.
  double fov_y_rad = 0;
  double share = 1;                 ///< Gaussians that each obstacle stands for.
  double clear = 0;                 ///< Geometry this close to a point is not in front of it.
  std::vector<Obstacle> obstacles;  ///< Within reach of the dome.
};

/// Median distance of the visible Gaussians from the centre, at least three sigmas of the smallest scene there is.
double cloud_scale(const scene::GaussianCloud& cloud, const Sample& sample, DVec3 centre) {
  std::vector<double> distance;
  double widest = 0;
  for (std::size_t k = 0; k < sample.size(); ++k) {
    const std::size_t i = sample.row(k);
    if (sigmoid(cloud.opacity_logit[i]) < 0.05) continue;
    distance.push_back(glm::length(DVec3(cloud.mean.get(i)) - centre));
    const Vec3 s = cloud.log_scale.get(i);
    widest = std::max(widest, std::exp(std::clamp(double(std::max({s.x, s.y, s.z})), -20.0, 20.0)));
  }
  if (distance.empty()) return 0;
  const auto middle = distance.begin() + std::ptrdiff_t(distance.size() / 2);
  std::nth_element(distance.begin(), middle, distance.end());
  // All Gaussians in one place (or just one): its own size is the only scale there is.
  return *middle > 0 ? *middle : 3 * widest;
}

Subject subject_of(const scene::GaussianCloud& cloud, const Sample& sample, std::span<const DVec3> points,
                   const VirtualCameraOptions& options) {
  Subject subject;
  DVec3 low = points[0], high = points[0];
  for (const DVec3& p : points) low = glm::min(low, p), high = glm::max(high, p);
  subject.centre = 0.5 * (low + high);
  for (const DVec3& p : points)
    subject.points_radius = std::max(subject.points_radius, glm::length(p - subject.centre));
  const std::size_t kept = std::min<std::size_t>(points.size(), 16);
  for (std::size_t k = 0; k < kept; ++k) subject.points.push_back(points[k * points.size() / kept] - subject.centre);

  const double dragged = subject.points_radius + options.radius;
  double framed = std::max(1.5 * dragged, 0.5 * cloud_scale(cloud, sample, subject.centre));
  // Nothing has a size. A millionth of the coordinates is about what float means can still tell apart.
  if (!(framed > 0)) framed = std::max(1.0, 1e-6 * glm::length(subject.centre));
  const double smaller_side = std::min(options.width, options.height);
  double half_fov = std::atan(std::tan(0.5 * options.fov_y_rad) * smaller_side / options.height);
  // A sphere of radius r around the point looked at fits the picture from r / sin(half the field of view) on.
  const double not_cut = 2 * options.near_plane + dragged;
  subject.far = std::max(framed / std::sin(half_fov), not_cut);
  half_fov = std::min(half_fov, std::asin(framed / subject.far));
  subject.near = std::max({1.2 * dragged / std::sin(half_fov), 0.2 * subject.far, not_cut});
  subject.far = std::max(subject.far, subject.near);
  subject.fov_y_rad = 2 * std::atan(std::tan(half_fov) * options.height / smaller_side);
  subject.clear = options.radius > 0 ? options.radius : framed / 8;

  subject.share = sample.share();
  const double reach_of_dome = 1.1 * subject.far;
  for (std::size_t k = 0; k < sample.size(); ++k) {
    const std::size_t i = sample.row(k);
    Obstacle o{DVec3(cloud.mean.get(i)) - subject.centre, 0, sigmoid(cloud.opacity_logit[i]), std::uint32_t(i)};
    if (o.opacity < 0.05) continue;  // fog: it dims, but it hides nothing
    const Vec3 s = cloud.log_scale.get(i);
    o.reach = 3 * std::exp(std::clamp(double(std::max({s.x, s.y, s.z})), -20.0, 20.0));
    if (glm::length(o.mean) <= reach_of_dome + o.reach) subject.obstacles.push_back(o);
  }
  return subject;
}

/// How well a camera sees the points.
struct Sight {
  bool inside = false;  ///< The camera is within or right beside geometry.
  double seen = 0;      ///< Fraction of the points that can be seen.
  [[nodiscard]] bool free() const { return !inside && seen >= 0.5; }
};

struct Shape {
  DVec3 mean;
  double reach;
  double opacity;
  DMat3 unit_from_world;
};

bool within(std::span<const Shape> shapes, DVec3 eye) {
  const double beside = 0.05 * glm::length(eye);
  for (const Shape& g : shapes) {
    const DVec3 away = eye - g.mean;
    const double distance = glm::length(away);
    if (distance < beside) return true;
    if (distance > g.reach) continue;
    const DVec3 sigmas = g.unit_from_world * away;
    if (g.opacity * std::exp(-0.5 * glm::dot(sigmas, sigmas)) > 0.1) return true;
  }
  return false;
}

/// Does a ray from the eye arrive at the point with at least half of its light?
bool can_see(std::span<const Shape> shapes, DVec3 eye, DVec3 point, double clear, double share) {
  const double length = glm::length(point - eye);
  const DVec3 direction = (point - eye) / length;
  double transmittance = 1;
  for (const Shape& g : shapes) {
    const DVec3 to_mean = g.mean - eye, off = to_mean - glm::dot(to_mean, direction) * direction;
    if (glm::dot(off, off) > g.reach * g.reach) continue;
    const DVec3 o = g.unit_from_world * -to_mean, d = g.unit_from_world * direction;
    const double along = -glm::dot(o, d) / glm::dot(d, d);  // world units: where the Gaussian is densest on the ray
    if (along <= 0 || along >= length - clear) continue;
    const DVec3 sigmas = o + along * d;
    const double passes = 1 - std::min(0.99, g.opacity * std::exp(-0.5 * glm::dot(sigmas, sigmas)));
    transmittance *= share == 1 ? passes : std::pow(passes, share);
    if (transmittance < 0.5) return false;
  }
  return true;
}

Sight look(const Subject& subject, std::span<const Shape> shapes, DVec3 eye) {
  if (within(shapes, eye)) return {.inside = true};
  const auto seen = std::count_if(subject.points.begin(), subject.points.end(), [&](DVec3 point) {
    return can_see(shapes, eye, point, subject.clear, subject.share);
  });
  return {.inside = false, .seen = double(seen) / double(subject.points.size())};
}

struct Placement {
  DVec3 eye;  ///< From the centre.
  Sight sight;
};

/// The farthest free distance in a direction, or the nearest distance there is.
Placement place(const scene::GaussianCloud& cloud, const Subject& subject, DVec3 direction) {
  // Everything that can matter lies in the capsule around the axis that holds all rays and the camera's surroundings.
  const double capsule = std::max(subject.points_radius, 0.05 * subject.far);
  std::vector<Shape> shapes;
  for (const Obstacle& o : subject.obstacles) {
    const double along = std::clamp(glm::dot(o.mean, direction), 0.0, subject.far);
    const DVec3 off = o.mean - along * direction;
    const double limit = capsule + o.reach;
    if (glm::dot(off, off) <= limit * limit)
      shapes.push_back({o.mean, o.reach, o.opacity, unit_from_world(cloud, o.row)});
  }
  constexpr int distances = 6;
  Placement placed;
  for (int k = 0; k < distances; ++k) {
    const double distance = subject.far * std::pow(subject.near / subject.far, double(k) / (distances - 1));
    placed.eye = distance * direction;
    placed.sight = look(subject, shapes, placed.eye);
    if (placed.sight.free()) break;
  }
  return placed;
}

/// A zero or infinite `up` names no direction; then it is the default.
DVec3 unit_up(DVec3 up) {
  const double length = glm::length(up);
  return length > 0 && std::isfinite(length) ? up / length : DVec3(0, -1, 0);
}

/// n directions on the dome, evenly spread, from its rim to its top.
std::vector<DVec3> dome(int n, DVec3 pole) {
  const DVec3 axis = std::abs(pole.x) < 0.5 ? DVec3(1, 0, 0) : DVec3(0, 0, 1);
  const DVec3 u = glm::normalize(glm::cross(pole, axis)), v = glm::cross(pole, u);
  const double degree = std::numbers::pi / 180, bottom = std::sin(10 * degree), top = std::sin(80 * degree);
  const double golden_angle = std::numbers::pi * (3 - std::sqrt(5.0));
  std::vector<DVec3> directions;
  for (int i = 0; i < n; ++i) {
    const double height = bottom + (top - bottom) * (i + 0.5) / n;
    const double ring = std::sqrt(1 - height * height), turn = golden_angle * i;
    directions.push_back(height * pole + ring * (std::cos(turn) * u + std::sin(turn) * v));
  }
  return directions;
}

std::vector<Placement> place_all(const scene::GaussianCloud& cloud, const Subject& subject,
                                 const std::vector<DVec3>& directions, const VirtualCameraOptions& options) {
  std::vector<Placement> placements(directions.size());
  std::atomic<bool> cancelled = false;
  const std::size_t grain = options.on_one_thread ? directions.size() : 4;
  parallel_for(directions.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end && !cancelled; ++i) {
      if (options.cancelled && options.cancelled()) cancelled = true;
      placements[i] = place(cloud, subject, directions[i]);
    }
  });
  if (cancelled) return {};
  return placements;
}

}  // namespace

std::vector<scene::Camera> virtual_cameras(const scene::GaussianCloud& cloud, std::span<const DVec3> points,
                                           const VirtualCameraOptions& options) {
  if (points.empty() || options.count < 1) return {};
  const Sample sample(cloud.size(), options.max_gaussians);
  const Subject subject = subject_of(cloud, sample, points, options);
  const DVec3 up = unit_up(options.up);
  const std::size_t wanted = std::size_t(options.count);

  std::vector<Placement> tried;
  std::vector<std::size_t> free;
  for (int density = 1; density <= 8 && free.size() < wanted; density *= 2) {
    tried = place_all(cloud, subject, dome(density * options.count, up), options);
    if (tried.empty()) return {};  // cancelled
    free.clear();
    for (std::size_t i = 0; i < tried.size(); ++i)
      if (tried[i].sight.free()) free.push_back(i);
  }
  if (free.empty()) {
    free.resize(tried.size());
    std::iota(free.begin(), free.end(), std::size_t{0});
    auto better = [&](std::size_t a, std::size_t b) {
      const Sight &left = tried[a].sight, &right = tried[b].sight;
      return left.inside != right.inside ? !left.inside : left.seen > right.seen;
    };
    std::stable_sort(free.begin(), free.end(), better);
    free.resize(wanted);
  }

  const std::size_t count = std::min(wanted, free.size());
  std::vector<scene::Camera> cameras;
  for (std::size_t k = 0; k < count; ++k) {
    const DVec3 eye = subject.centre + tried[free[k * free.size() / count]].eye;  // evenly through the lattice
    cameras.push_back(scene::look_at(eye, subject.centre, up, subject.fov_y_rad, options.width, options.height));
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "virtual_%02zu", k);
    cameras.back().name = name.data();
  }
  return cameras;
}

}  // namespace engine::views
