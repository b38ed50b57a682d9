#include "engine/repair/seed.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/half_axes.h"
#include "engine/scene/opacity.h"
#include "engine/scene/sh.h"

namespace engine::repair {
namespace {

constexpr double sigma_px = 0.6;       // of a seed, in the distance of seeds: no gaps between them, and little blur
constexpr double steepest = 8;         // seeds are not drawn out to more than so many pixels, wherever depth jumps
constexpr double flatness = 0.1;       // thickness over width
constexpr double seed_opacity = 0.95;  // the optimisation can still move it
constexpr std::size_t most_seeds = 20000;

/// A Gaussian to be.
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

/// The slope of the surface at a pixel, from a neighbour that it has as well: inverse depth per pixel to the right and
/// down. Without such a neighbour the surface faces the camera.
DVec2 slope_at(const scene::Image& inverse_depth, int x, int y) {
  constexpr double same_surface = 0.1;  // relative difference of inverse depths
  const double here = double(inverse_depth.at(x, y));
  const auto step_to = [&](int u, int v) -> std::optional<double> {
    const bool inside = u >= 0 && v >= 0 && u < inverse_depth.width && v < inverse_depth.height;
    const double value = inside ? double(inverse_depth.at(u, v)) : 0;
    if (value > 0 && std::abs(value - here) < same_surface * here) return value - here;
    return std::nullopt;
  };
  const auto slope = [](std::optional<double> ahead, std::optional<double> behind) {
    return ahead ? *ahead : behind ? -*behind : 0.0;
  };
  return {slope(step_to(x + 1, y), step_to(x - 1, y)), slope(step_to(x, y + 1), step_to(x, y - 1))};
}

/// A seed for each pixel that has a surface; where that were too many, for every second, third, ... row and column.
std::vector<Seed> seeds_on(const scene::Camera& camera, const scene::Image& inverse_depth,
                           const scene::Image& picture) {
  const auto wanted = std::size_t(
      std::count_if(inverse_depth.data.begin(), inverse_depth.data.end(), [](float value) { return value > 0; }));
  const int every = std::max(1, int(std::ceil(std::sqrt(double(wanted) / double(most_seeds)))));
  std::vector<Seed> seeds;
  for (int y = 0; y < inverse_depth.height; y += every)
    for (int x = 0; x < inverse_depth.width; x += every) {
      const double here = double(inverse_depth.at(x, y));
      if (!(here > 0)) continue;
      const DVec2 slope = slope_at(inverse_depth, x, y), pixel(x + 0.5, y + 0.5);
      Seed& seed = seeds.emplace_back();
      seed.mean = point_at(camera, pixel, here);
      seed.along_x = double(every) * (point_at(camera, pixel + DVec2(1, 0), here + slope.x) - seed.mean);
      seed.along_y = double(every) * (point_at(camera, pixel + DVec2(0, 1), here + slope.y) - seed.mean);
      const double across = 1 / (here * std::min(camera.fx, camera.fy)) * every;
      for (DVec3* side : {&seed.along_x, &seed.along_y})
        if (const double length = glm::length(*side); length > steepest * across) *side *= steepest * across / length;
      seed.color = {picture.at(x, y, 0), picture.at(x, y, 1), picture.at(x, y, 2)};
    }
  return seeds;
}

/// The input's row nearest to each seed.
std::vector<std::uint32_t> nearest_rows(std::span<const Seed> seeds, const neighbours::PointIndex& inputs) {
  std::vector<float> queries;
  for (const Seed& seed : seeds)
    for (int axis = 0; axis < 3; ++axis) queries.push_back(float(seed.mean[axis]));
  std::vector<std::uint32_t> rows;
  for (const neighbours::Neighbour& nearest : inputs.nearest(queries, 1)) rows.push_back(nearest.index);
  return rows;
}

void set_gaussian(scene::GaussianCloud& cloud, std::size_t row, const Seed& seed) {
  cloud.mean.set(row, Vec3(seed.mean));
  set_shape(cloud, row, seed.along_x, seed.along_y);
  cloud.opacity_logit[row] = float(scene::logit(seed_opacity));
  const auto sh = cloud.sh_row(row);
  std::fill(sh.begin(), sh.end(), 0.0f);
  for (int c = 0; c < 3; ++c)
    sh[std::size_t(c) * scene::sh_coefficients(cloud.sh_degree)] = (seed.color[c] - 0.5f) / float(scene::sh_c0);
}

}  // namespace

DVec3 point_at(const scene::Camera& camera, DVec2 pixel, double inverse_depth) {
  const double z = 1 / inverse_depth;
  return camera.world_from_cam({(pixel.x - camera.cx) / camera.fx * z, (pixel.y - camera.cy) / camera.fy * z, z});
}

std::size_t add_seeds(WorkingScene& working, const scene::Camera& camera, const scene::Image& inverse_depth,
                      const scene::Image& picture, const neighbours::PointIndex& inputs) {
  const std::vector<Seed> seeds = seeds_on(camera, inverse_depth, picture);
  if (seeds.empty()) return 0;
  const std::vector<std::uint32_t> parents = nearest_rows(seeds, inputs);
  const std::vector<working::Role> roles(seeds.size(), working::Role::seed);
  const std::uint32_t first = working.append(working.cloud(), parents, roles, parents);
  for (std::size_t k = 0; k < seeds.size(); ++k) {
    set_gaussian(working.gaussians(), first + k, seeds[k]);
    working.note_mean(std::uint32_t(first + k));  // not its parent's: it has come from nowhere
  }
  return seeds.size();
}

}  // namespace engine::repair
