#include "engine/repair/relight.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/render/project.h"
#include "engine/repair/spots.h"
#include "engine/scene/sh.h"

namespace engine::repair {
namespace {

constexpr float as_before = 0.01f;  // a change of less nobody sees
// Extents of the part up to which a row's longest axis may lie in one light. With 0.15 more of a shadow stays: the
// captured case can_shadow is 1.6 dB worse where the can was.
constexpr double most_wide = 0.25;

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
    if (!(was_near || is_near) || std::ranges::binary_search(part, row)) continue;
    if (longest_axis(scene, row) < most_wide * shadow.extent() &&
        render::opacity<float>(scene.opacity_logit[row]) >= render::min_alpha)
      near.push_back(row);
  }
  const std::vector<Vec3> before = light_on(scene, near, shadow, {});
  const std::vector<Vec3> after = back ? light_on(scene, near, shadow, back) : std::vector<Vec3>(near.size(), Vec3(1));
  for (std::size_t k = 0; k < near.size(); ++k) {
    const Vec3 light = after[k] / before[k];
    if (glm::all(glm::lessThan(glm::abs(light - 1.0f), Vec3(as_before)))) continue;
    out.rows.push_back(near[k]), out.light.push_back(light);
  }
  return out;
}

std::size_t relight(WorkingScene& working, const Relit& relit) {
  const std::size_t coefficients = scene::sh_coefficients(working.cloud().sh_degree);
  std::size_t count = 0;
  for (std::size_t k = 0; k < relit.rows.size(); ++k) {
    const std::uint32_t row = relit.rows[k];
    if (!working::stays(working.role()[row])) continue;
    working.relight(row);
    const std::span<float> sh = working.gaussians().sh_row(row);
    for (std::size_t c = 0; c < 3; ++c) {
      const float factor = relit.light[k][int(c)];
      for (std::size_t n = 0; n < coefficients; ++n) sh[c * coefficients + n] *= factor;
      // A colour is 0.5 and the sum of these.
      sh[c * coefficients] += 0.5f * (factor - 1) / float(scene::sh_c0);
    }
    ++count;
  }
  return count;
}

}  // namespace engine::repair
