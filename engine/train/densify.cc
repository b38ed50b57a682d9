#include "engine/train/densify.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "engine/render/project.h"

namespace engine::train {
namespace {

constexpr double shrink_of_split = 1.6;  // factor by which a split divides every extent. Source: Kerbl et al. 2023

/// A position drawn from the Gaussian.
Vec3 drawn(Vec3 mean, DVec3 sigma, DMat3 rotation, Rng& rng) {
  DVec3 local;
  for (int axis = 0; axis < 3; ++axis) local[axis] = sigma[axis] * double(rng.normal());
  return Vec3(DVec3(mean) + rotation * local);
}

}  // namespace

float halved_opacity(float logit) {
  // 1 - alpha is the opacity of the negated logit: subtracted from 1, alpha near 1 would lose its digits.
  const double through = std::sqrt(render::opacity<double>(-double(logit)));  // sqrt(1 - alpha)
  return float(std::log1p(-through) - std::log(through));
}

void PositionGradientStatistic::reset(std::size_t rows) {
  sum.assign(rows, 0.0);
  views.assign(rows, 0);
}

void PositionGradientStatistic::add(const render::Gradients& gradients, const scene::Camera& camera) {
  assert(gradients.size() == sum.size());
  for (std::size_t i = 0; i < sum.size(); ++i) {
    const double x = double(gradients.mean2d_x_px[i]) * camera.width / 2,
                 y = double(gradients.mean2d_y_px[i]) * camera.height / 2;
    if (x == 0 && y == 0) continue;
    sum[i] += std::sqrt(x * x + y * y);
    ++views[i];
  }
}

void PositionGradientStatistic::keep_rows(std::span<const std::uint8_t> keep) {
  assert(keep.size() == sum.size());
  std::size_t remaining = 0;
  for (std::size_t row = 0; row < keep.size(); ++row)
    if (keep[row] != 0) sum[remaining] = sum[row], views[remaining] = views[row], ++remaining;
  sum.resize(remaining), views.resize(remaining);
}

std::vector<std::uint32_t> rows_to_densify(const PositionGradientStatistic& statistic, double threshold,
                                           std::size_t max_rows) {
  const auto mean = [&](std::uint32_t row) { return statistic.sum[row] / std::max<double>(statistic.views[row], 1); };
  std::vector<std::uint32_t> rows;
  for (std::size_t i = 0; i < statistic.sum.size(); ++i)
    if (mean(std::uint32_t(i)) > threshold) rows.push_back(std::uint32_t(i));
  if (rows.size() <= max_rows) return rows;
  std::stable_sort(rows.begin(), rows.end(), [&](std::uint32_t a, std::uint32_t b) { return mean(a) > mean(b); });
  rows.resize(max_rows);
  std::sort(rows.begin(), rows.end());
  return rows;
}

void add_children(scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows, double larger_than, Rng& rng) {
  const std::size_t first = cloud.size();
  scene::append_rows(cloud, cloud, rows);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const std::size_t parent = rows[k], child = first + k;
    const Vec3 mean = cloud.mean.get(parent), log_scale = cloud.log_scale.get(parent);
    DVec3 sigma;
    for (int axis = 0; axis < 3; ++axis)
      sigma[axis] =
          std::exp(std::clamp(double(log_scale[axis]), -double(render::max_log_scale), double(render::max_log_scale)));
    if (std::max({sigma.x, sigma.y, sigma.z}) > larger_than) {
      const Quat stored = cloud.rotation.get(parent);
      const DQuat q(stored.w, stored.x, stored.y, stored.z);
      const double length = glm::length(q);
      const DMat3 rotation = length > 0 ? glm::mat3_cast(q / length) : DMat3(1.0);
      for (const std::size_t row : {parent, child}) {
        cloud.mean.set(row, drawn(mean, sigma, rotation, rng));
        cloud.log_scale.set(row, log_scale - Vec3(float(std::log(shrink_of_split))));
      }
    } else {
      cloud.opacity_logit[parent] = cloud.opacity_logit[child] = halved_opacity(cloud.opacity_logit[parent]);
    }
  }
}

}  // namespace engine::train
