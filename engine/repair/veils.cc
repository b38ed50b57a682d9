#include "engine/repair/veils.h"

#include <algorithm>
#include <cstddef>

#include "engine/render/weight_sums.h"

namespace engine::repair {
namespace {

// Chosen on the captured cases board, mug, pouf and turn, and looked at on a doll that is shifted along its quilt.
constexpr double most_of_it = 0.5;  // of a row's light
constexpr double seen_as_veil =
    0.02;  // of the part's light: a board loses a fifth to the veil of its table, others 1 %
// A layer of what the part grew out of had this much of its light before the part already.
constexpr double was_there = 0.1;
constexpr float covered = 0.5f;         // from this opacity of the part on a pixel shows it
constexpr std::size_t most_views = 12;  // a choice, as the next one
constexpr int side = 320;               // pixels

/// Sums over views of what rows contribute to pictures, and where they are in them. Each [rows].
struct Light {
  std::vector<double> all;
  std::vector<double> on_part;      ///< Where the part is before everything else.
  std::vector<int> before, behind;  ///< Views in which the row is before or behind the part, where the part is so.
};

/// Pixels that the part covers, and in which it is before the rest; 1, else 0. [1]
scene::Image shows_part(const render::Rendering& part, const render::Rendering& rest) {
  scene::Image shows(part.alpha.width, part.alpha.height, 1);
  for (std::size_t i = 0; i < shows.data.size(); ++i) {
    const float alpha = part.alpha.data[i], behind = rest.median_depth.data[i];
    shows.data[i] = alpha > covered && (behind == 0 || part.depth.data[i] < behind * alpha) ? 1.0f : 0.0f;
  }
  return shows;
}

/// Notes which rows are before the part, and which behind it.
void compare_depths(const Array3& means, const scene::Camera& view, const render::Rendering& part,
                    const scene::Image& shows, Light& light) {
  for (std::size_t row = 0; row < means.size(); ++row) {
    const DVec3 p = view.cam_from_world(means.get(row));
    if (!(p.z > 0)) continue;
    const DVec2 pixel = view.pixel_from_cam(p);
    if (!(pixel.x >= 0 && pixel.y >= 0 && pixel.x < view.width && pixel.y < view.height)) continue;
    const int x = int(pixel.x), y = int(pixel.y);
    if (shows.at(x, y) == 0) continue;
    ++(p.z * double(part.alpha.at(x, y)) < double(part.depth.at(x, y)) ? light.before : light.behind)[row];
  }
}

/// What the rows of a scene contribute.
///   part    rows of it
///   hidden  rows of it that are not there, ascending
Light light_on(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> part,
               std::span<const std::uint32_t> hidden, std::span<const scene::Camera> views,
               render::Workspace& workspace) {
  scene::GaussianCloud alone;
  alone.sh_degree = cloud.sh_degree, alone.extra_stride = cloud.extra_stride;
  scene::append_rows(alone, cloud, part);
  std::vector<std::uint32_t> all_but_rest;
  std::ranges::set_union(part, hidden, std::back_inserter(all_but_rest));
  render::Layers scene(cloud), rest(cloud);
  scene.hidden = hidden, rest.hidden = all_but_rest;
  render::ForwardOptions depth_only;
  depth_only.color = false, depth_only.depth = true;
  const std::size_t rows = cloud.size();
  Light light{std::vector<double>(rows), std::vector<double>(rows), std::vector<int>(rows), std::vector<int>(rows)};
  render::Rendering of_part, of_rest;
  for (const scene::Camera& view : views) {
    render::forward(alone, view, depth_only, {}, workspace, of_part);
    render::forward(rest, view, depth_only, {}, workspace, of_rest);
    const scene::Image shows = shows_part(of_part, of_rest);
    render::add_weight_sums(scene, view, shows, workspace, light.all, light.on_part);
    compare_depths(cloud.mean, view, of_part, shows, light);
  }
  return light;
}

std::vector<scene::Camera> small_ones(std::span<const scene::Camera> views) {
  std::vector<scene::Camera> out;
  for (const scene::Camera& view : views.first(std::min(views.size(), most_views)))
    out.push_back(scene::fit_within(view, side));
  return out;
}

}  // namespace

std::vector<std::uint32_t> veils_before(const WorkingScene& working, const scene::GaussianCloud& original,
                                        std::span<const std::uint32_t> left, std::span<const std::uint32_t> arrived,
                                        std::span<const scene::Camera> views, render::Workspace& workspace) {
  std::vector<std::uint32_t> veils;
  if (arrived.empty() || left.empty()) return veils;
  const std::vector<scene::Camera> small = small_ones(views);
  const Light now = light_on(working.cloud(), arrived, working.rows_that_left(), small, workspace);
  double of_part = 0, of_veils = 0;
  for (const std::uint32_t row : arrived) of_part += now.on_part[row];
  for (std::uint32_t row = 0; row < working.input_rows(); ++row) {
    const bool is_before = now.before[row] > now.behind[row] && now.on_part[row] > most_of_it * now.all[row];
    if (!is_before || working.role()[row] != working::Role::frozen) continue;
    veils.push_back(row);
    of_veils += now.on_part[row];
  }
  if (!(of_veils > seen_as_veil * (of_part + of_veils))) return {};
  const Light before = light_on(original, left, {}, small, workspace);
  std::erase_if(veils, [&](std::uint32_t row) { return before.on_part[row] > was_there * before.all[row]; });
  return veils;
}

}  // namespace engine::repair
