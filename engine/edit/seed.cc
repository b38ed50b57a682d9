#include "engine/edit/seed.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "engine/core/half_axes.h"
#include "engine/scene/opacity.h"
#include "engine/scene/sh.h"

namespace engine::edit {
namespace {

constexpr double sigma_px = 0.6;       // of a seed, in the distance of seeds: no gaps between them, and little blur
constexpr double flatness = 0.1;       // thickness over width
constexpr double seed_opacity = 0.95;  // the optimisation can still move it
constexpr std::size_t most_seeds = 20000;

struct Seed {
  DVec3 mean{0.0}, along_x{0.0}, along_y{0.0};  ///< The pixel on the surface and its sides, world units.
  Vec3 color{0.0f};
};

/// Sides of an ellipse that covers the parallelogram of two vectors: singular vectors of [a b].
void set_shape(scene::GaussianCloud& cloud, std::size_t row, DVec3 a, DVec3 b) {
  const auto [u, v] = half_axes(a, b);
  const double lu = std::max(glm::length(u), 1e-12), lv = std::max(glm::length(v), 1e-12);
  const DVec3 first = u / lu;
  DVec3 normal = glm::cross(first, v / lv);
  const double length = glm::length(normal);
  normal = length > 0 ? normal / length : DVec3(0, 0, 1);
  const DMat3 axes(first, glm::cross(normal, first), normal);
  cloud.rotation.set(row, Quat(glm::normalize(glm::quat_cast(axes))));
  cloud.log_scale.set(row, Vec3(DVec3(std::log(sigma_px * lu), std::log(sigma_px * lv),
                                      std::log(flatness * sigma_px * std::min(lu, lv)))));
}

}  // namespace

DVec3 point_at(const scene::Camera& camera, DVec2 pixel, double inverse_depth) {
  const double z = 1 / inverse_depth;
  return camera.world_from_cam({(pixel.x - camera.cx) / camera.fx * z, (pixel.y - camera.cy) / camera.fy * z, z});
}

std::size_t add_seeds(WorkingScene& working, const scene::Camera& camera, const scene::Image& inverse_depth,
                      const scene::Image& picture, const neighbours::PointIndex& inputs) {
  std::vector<Seed> seeds;
  const auto wanted = std::size_t(
      std::count_if(inverse_depth.data.begin(), inverse_depth.data.end(), [](float value) { return value > 0; }));
  const int every = std::max(1, int(std::ceil(std::sqrt(double(wanted) / double(most_seeds)))));
  for (int y = 0; y < inverse_depth.height; y += every)
    for (int x = 0; x < inverse_depth.width; x += every) {
      const double here = double(inverse_depth.at(x, y));
      if (!(here > 0)) continue;
      // Slope of the surface from a neighbour that it has as well.
      const auto beside = [&](int u, int v) {
        const bool there = u >= 0 && v >= 0 && u < inverse_depth.width && v < inverse_depth.height;
        const double value = there ? double(inverse_depth.at(u, v)) : 0;
        return value > 0 && std::abs(value - here) < 0.1 * here ? value - here
                                                                : std::numeric_limits<double>::quiet_NaN();
      };
      const auto slope = [](double ahead, double behind) {
        if (std::isnan(ahead)) return std::isnan(behind) ? 0.0 : -behind;
        return ahead;
      };
      const double dx = slope(beside(x + 1, y), beside(x - 1, y)), dy = slope(beside(x, y + 1), beside(x, y - 1));
      const DVec2 pixel(x + 0.5, y + 0.5);
      Seed seed;
      seed.mean = point_at(camera, pixel, here);
      seed.along_x = double(every) * (point_at(camera, pixel + DVec2(1, 0), here + dx) - seed.mean);
      seed.along_y = double(every) * (point_at(camera, pixel + DVec2(0, 1), here + dy) - seed.mean);
      seed.color = {picture.at(x, y, 0), picture.at(x, y, 1), picture.at(x, y, 2)};
      seeds.push_back(seed);
    }
  if (seeds.empty()) return 0;

  std::vector<float> queries;
  for (const Seed& seed : seeds)
    for (int axis = 0; axis < 3; ++axis) queries.push_back(float(seed.mean[axis]));
  const auto nearest = inputs.nearest(queries, 1);

  const std::size_t first = working.cloud.size();
  std::vector<std::uint32_t> parents;
  for (const neighbours::Neighbour& neighbour : nearest) parents.push_back(neighbour.index);
  scene::append_rows(working.cloud, working.cloud, parents);
  for (std::size_t k = 0; k < seeds.size(); ++k) {
    const std::size_t row = first + k;
    working.cloud.mean.set(row, Vec3(seeds[k].mean));
    set_shape(working.cloud, row, seeds[k].along_x, seeds[k].along_y);
    working.cloud.opacity_logit[row] = float(scene::logit(seed_opacity));
    const auto sh = working.cloud.sh_row(row);
    std::fill(sh.begin(), sh.end(), 0.0f);
    for (int c = 0; c < 3; ++c)
      sh[std::size_t(c) * scene::sh_coefficients(working.cloud.sh_degree)] =
          (seeds[k].color[c] - 0.5f) / float(scene::sh_c0);
    working.handle.push_back(0);
    working.role.push_back(Role::seed);
    working.parent.push_back(parents[k]);
    working.mean_at_deform.push_back(working.cloud.mean.get(row));
  }
  return seeds.size();
}

}  // namespace engine::edit
