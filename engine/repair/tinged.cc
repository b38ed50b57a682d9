#include "engine/repair/tinged.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "engine/neighbours/neighbour_graph.h"
#include "engine/scene/base_color.h"

namespace engine::repair {
namespace {

// Known rows around a row that it is compared with. With 64 captured cases are alike.
constexpr std::size_t rows_around = 32;
// Distance of a colour from the mean of its like, from which on it is none of those around it. From 0.03 to 0.08
// captured cases are alike: the fewer are changed.
constexpr float odd_color = 0.08f;

/// A colour in as much of its light as makes it most like another; never in more.
Vec3 in_less_light(Vec3 color, Vec3 other) {
  const float all = glm::dot(color, color);
  return all > 0 ? std::clamp(glm::dot(color, other) / all, 0.0f, 1.0f) * color : color;
}

struct Alike {
  Like rows{};
  Vec3 mean{0.0f};
};

/// Those of some rows whose colours differ least.
template <class Difference>
Alike most_alike(const scene::GaussianCloud& scene, std::span<const std::uint32_t> rows, const Difference& difference) {
  std::vector<std::pair<float, std::uint32_t>> by_color;  // difference, row
  for (const std::uint32_t row : rows) by_color.emplace_back(difference(scene::base_color(scene, row)), row);
  std::ranges::partial_sort(by_color, by_color.begin() + colors_alike);
  Alike out;
  for (std::size_t k = 0; k < colors_alike; ++k) {
    out.rows[k] = by_color[k].second;
    out.mean += scene::base_color(scene, out.rows[k]) / float(colors_alike);
  }
  return out;
}

}  // namespace

Tinged tinged_among(const scene::GaussianCloud& scene, std::span<const std::uint32_t> rows,
                    std::span<const std::uint32_t> known, bool shade_stays) {
  Tinged out;
  if (known.size() < colors_alike) return out;
  const std::size_t around = std::min(rows_around, known.size());
  const std::vector<std::uint32_t> nearest = neighbours::nearest_rows(scene.mean, known, rows, around);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Vec3 own = scene::base_color(scene, rows[i]);
    const auto beside = std::span(nearest).subspan(i * around, around);
    const auto plain = [&](Vec3 color) { return glm::distance(own, color); };
    const auto in_shade = [&](Vec3 color) { return plain(in_less_light(color, own)); };
    const Alike alike = most_alike(scene, beside, plain);
    if (plain(alike.mean) <= odd_color) continue;
    if (shade_stays && in_shade(most_alike(scene, beside, in_shade).mean) <= odd_color) continue;
    // Rather those in as much light as it has: what is tinged in a shadow stays in it.
    out.rows.push_back(rows[i]), out.like.push_back(alike.rows);
  }
  return out;
}

void recolour(WorkingScene& working, const Tinged& tinged) {
  for (std::size_t i = 0; i < tinged.rows.size(); ++i) {
    const std::uint32_t row = tinged.rows[i];
    if (!working::stays(working.role()[row])) continue;
    working.relight(row);
    const std::span<float> sh = working.gaussians().sh_row(row);
    std::ranges::fill(sh, 0.0f);
    for (const std::uint32_t like : tinged.like[i]) {
      const std::span<const float> of_like = working.gaussians().sh_row(like);
      for (std::size_t k = 0; k < sh.size(); ++k) sh[k] += of_like[k] / float(colors_alike);
    }
  }
}

}  // namespace engine::repair
