#include "engine/render/pick.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "engine/render/project.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

// Pixels. The surface is fitted on a square of 2 reach + 1 pixels around the position. A choice.
constexpr int reach = 3;
// tan(80 degrees). A surface seen at more than 80 degrees from its normal is taken for an edge between two surfaces. A
// choice.
constexpr double steepest = 5.67;

/// What one ray blends, up to where its transmittance falls below one half and to its end.
struct Ray {
  double median_depth = 0;   ///< 0: transmittance stays at one half or more.
  std::size_t heaviest = 0;  ///< Splat with the largest blending weight.
};

/// dense_stop at any position, in pixel-index units; scalar and in double.
Ray blend(std::span<const Splat> splats, DVec2 at) {
  Ray ray;
  double transmittance = 1, heaviest = 0;
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const Splat& splat = splats[i];
    const double dx = at.x - splat.x, dy = at.y - splat.y;
    const double u = splat.l1 * dx + splat.l2 * dy, v = splat.l3 * dy;
    const double power = splat.log2_opacity - u * u - v * v;
    if (power < -double(log2_255)) continue;
    const double alpha = std::min(max_alpha, std::exp2(power));
    const double after = transmittance * (1 - alpha);
    if (after < min_transmittance) break;
    if (transmittance * alpha > heaviest) heaviest = transmittance * alpha, ray.heaviest = i;
    if (transmittance >= 0.5 && after < 0.5) ray.median_depth = splat.depth;
    transmittance = after;
  }
  return ray;
}

/// The plane 1 / z = a x + b y + c through points seen at (x, y) on the plane z = 1, by least squares: its normal in
/// camera axes is along (a, b, c). Nothing where the points do not span a plane.
class PlaneFit {
 public:
  void add(double x, double y, double inverse_z) {
    const std::array<double, 3> row{x, y, 1};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) normal_[j][i] += row[std::size_t(i)] * row[std::size_t(j)];
      right_[i] += row[std::size_t(i)] * inverse_z;
    }
  }
  [[nodiscard]] std::optional<DVec3> solve() const {
    const double determinant = glm::determinant(normal_);
    if (!(std::abs(determinant) > 1e-9)) return std::nullopt;
    return glm::inverse(normal_) * right_;
  }

 private:
  DMat3 normal_{0.0};
  DVec3 right_{0.0};
};

/// Normal in camera axes, towards the camera or away from it, from the median depths around. Nothing at a silhouette.
std::optional<DVec3> surface_normal(std::span<const Splat> splats, const scene::Camera& camera, DVec2 at,
                                    double depth) {
  const double focal = std::min(camera.fx, camera.fy);
  const double largest_step = depth * steepest * reach / focal;
  PlaneFit fit;
  int members = 0;
  for (int y = -reach; y <= reach; ++y)
    for (int x = -reach; x <= reach; ++x) {
      const double z = x == 0 && y == 0 ? depth : blend(splats, at + DVec2(x, y)).median_depth;
      if (z == 0 || std::abs(z - depth) > largest_step) continue;
      ++members;
      fit.add(x, y, depth / z);  // in pixels and in units of the depth: numbers near 1
    }
  if (2 * members <= (2 * reach + 1) * (2 * reach + 1)) return std::nullopt;
  const auto plane = fit.solve();
  if (!plane) return std::nullopt;
  // From pixels around `at` to positions on the plane z = 1: x_pixel = fx x + cx - at.x.
  const DVec2 centre(camera.cx - 0.5 - at.x, camera.cy - 0.5 - at.y);
  return DVec3(plane->x * camera.fx, plane->y * camera.fy, plane->z + plane->x * centre.x + plane->y * centre.y);
}

/// Local axis of the smallest scale, in world axes.
DVec3 shortest_axis(const scene::GaussianCloud& cloud, std::size_t row) {
  const Vec3 scale = cloud.log_scale.get(row);
  const int axis = scale.x <= scale.y ? (scale.x <= scale.z ? 0 : 2) : (scale.y <= scale.z ? 1 : 2);
  const Quat stored = cloud.rotation.get(row);
  DQuat q(stored.w, stored.x, stored.y, stored.z);
  // Not unit_quaternion(), which is for projection, and rounds otherwise: answers keep their last digit.
  const double largest = std::max({std::abs(q.w), std::abs(q.x), std::abs(q.y), std::abs(q.z), 1e-30});
  q /= largest;
  const double length = std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  q *= 1 / std::max(length, 1e-12 / largest);
  return glm::mat3_cast(q)[axis];
}

}  // namespace

std::optional<PixelHit> pick(const Layers& layers, const scene::Camera& camera, DVec2 pixel, Workspace& workspace) {
  if (!(pixel.x >= 0 && pixel.x < camera.width && pixel.y >= 0 && pixel.y < camera.height)) return std::nullopt;
  const DVec2 at = pixel - 0.5;  // pixel-index units, as splats have
  // Projection drops what reaches no pixel centre of the rectangle; one pixel more on each side holds all positions.
  const int x = int(std::floor(at.x)), y = int(std::floor(at.y));
  const scene::Rect around{x - reach - 1, y - reach - 1, x + reach + 3, y + reach + 3};
  ForwardBuffers& buffers = workspace.impl_->buffers;
  project(layers, view_params<float>(camera), /*sh_degree=*/-1, {}, Culling::by_bound, around, buffers);
  sort_by_depth(buffers);
  std::vector<Splat> splats;  // nearest first
  splats.reserve(buffers.by_depth.size());
  for (const DepthKey& keyed : buffers.by_depth) splats.push_back(buffers.splats[keyed.splat]);

  const Ray ray = blend(splats, at);
  if (ray.median_depth == 0) return std::nullopt;
  PixelHit hit;
  hit.depth = ray.median_depth;
  hit.point = camera.world_from_cam(
      {(pixel.x - camera.cx) / camera.fx * hit.depth, (pixel.y - camera.cy) / camera.fy * hit.depth, hit.depth});
  const std::size_t row = splats[ray.heaviest].row;
  hit.row = layers.merged_row(row);

  const bool on_top = row >= layers.base->size();
  const auto surface = surface_normal(splats, camera, at, hit.depth);
  DVec3 normal = surface ? glm::transpose(camera.rotation) * *surface
                         : shortest_axis(on_top ? *layers.top : *layers.base, on_top ? row - layers.base->size() : row);
  if (glm::dot(normal, camera.ray_direction(pixel)) > 0) normal = -normal;
  hit.normal = glm::normalize(normal);
  return hit;
}

}  // namespace engine::render
