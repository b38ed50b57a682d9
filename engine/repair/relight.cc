#include "engine/repair/relight.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/scene/sh.h"

namespace engine::repair {
namespace {

constexpr float no_light = 0.2f;    // less of it is not believed: what is lit five times is mostly noise
constexpr float as_before = 0.01f;  // a change of less nobody sees

/// The middle of a row, and the ends of its two longer axes: where it is lit.
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

/// Of each of these rows, the mean over its spots.
///   back  as in relit_rows(), or empty for places as they are
std::vector<Vec3> light_on(const scene::GaussianCloud& scene, std::span<const std::uint32_t> rows, const Shadow& shadow,
                           const std::function<DVec3(DVec3)>& back) {
  std::vector<DVec3> spots;
  for (const std::uint32_t row : rows)
    for (const DVec3& spot : spots_of(scene, row)) spots.push_back(back ? back(spot) : spot);
  const std::vector<Vec3> light = shadow.light_at(spots);
  std::vector<Vec3> out(rows.size(), Vec3(0.0f));
  const std::size_t each = rows.empty() ? 1 : spots.size() / rows.size();
  for (std::size_t i = 0; i < light.size(); ++i) out[i / each] += light[i] / float(each);
  return out;
}

}  // namespace

Relit relit_rows(const scene::GaussianCloud& scene, std::span<const std::uint32_t> part, const Shadow& shadow,
                 const std::function<DVec3(DVec3)>& back) {
  Relit out;
  if (shadow.empty()) return out;
  std::vector<std::uint32_t> near;
  for (std::uint32_t row = 0; row < scene.size(); ++row) {
    const DVec3 mean(scene.mean.get(row));
    const bool was_near = glm::distance(mean, shadow.middle()) < shadow.reach();
    const bool is_near = back && glm::distance(back(mean), shadow.middle()) < shadow.reach();
    if ((was_near || is_near) && !std::ranges::binary_search(part, row)) near.push_back(row);
  }
  const std::vector<Vec3> before = light_on(scene, near, shadow, {});
  const std::vector<Vec3> after = back ? light_on(scene, near, shadow, back) : std::vector<Vec3>(near.size(), Vec3(1));
  for (std::size_t k = 0; k < near.size(); ++k) {
    const Vec3 light = glm::max(after[k], Vec3(no_light)) / glm::max(before[k], Vec3(no_light));
    if (glm::all(glm::lessThan(glm::abs(light - 1.0f), Vec3(as_before)))) continue;
    out.rows.push_back(near[k]), out.light.push_back(light);
  }
  return out;
}

std::vector<std::uint32_t> relight(WorkingScene& working, const Relit& relit) {
  std::vector<std::uint32_t> rows;
  std::vector<Vec3> light;
  for (std::size_t k = 0; k < relit.rows.size(); ++k)
    if (working.role()[relit.rows[k]] == working::Role::frozen)
      rows.push_back(relit.rows[k]), light.push_back(relit.light[k]);
  const std::uint32_t first =
      working.append(working.cloud(), rows, std::vector<working::Role>(rows.size(), working::Role::relit), rows);
  const std::size_t coefficients = scene::sh_coefficients(working.cloud().sh_degree);
  for (std::uint32_t k = 0; k < rows.size(); ++k) {
    working.give_up(rows[k]);
    const std::span<float> sh = working.gaussians().sh_row(first + k);
    for (std::size_t c = 0; c < 3; ++c) {
      const float factor = light[k][int(c)];
      for (std::size_t n = 0; n < coefficients; ++n) sh[c * coefficients + n] *= factor;
      // A colour is 0.5 and the sum of these.
      sh[c * coefficients] += 0.5f * (factor - 1) / float(scene::sh_c0);
    }
    rows[k] = first + k;
  }
  return rows;
}

}  // namespace engine::repair
