#include "engine/repair/veils.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>

#include "engine/core/rows.h"
#include "engine/render/weight_sums.h"
#include "engine/repair/part_shown.h"

namespace engine::repair {
namespace {

// Chosen on the captured cases board, mug, pouf and turn.
constexpr double most_of_it = 0.5;  // of a row's light
// Of the part's light: a board loses a fifth to the veil of its table, others a hundredth at most.
constexpr double seen_as_veil = 0.02;
// A layer of what the part grew out of had this much of its light before the part already.
constexpr double was_there = 0.1;
// By so much, root mean square over the pixels where they have a tenth, may a picture change without them: what hangs
// before a floor has nearly its colour.
constexpr double looks_alike = 0.03, tenth = 0.1;
constexpr std::size_t most_views = 12;  // a choice, as the next one
constexpr int side = 320;               // pixels

/// What views tell of each row, [rows]: sums of what it contributes to pictures, and in how many it is where.
struct Told {
  std::vector<double> light;
  std::vector<double> on_part;        ///< Of it, at pixels that show the part before what is solid of the rest.
  std::vector<int> in_front, behind;  ///< Views in which its mean is at such a pixel: before the part, or behind it.
};

/// What the rows of a scene contribute.
///   part    rows of it
///   hidden  rows of it that are not there, ascending
Told told_of(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> part,
             std::span<const std::uint32_t> hidden, std::span<const scene::Camera> views,
             render::Workspace& workspace) {
  scene::GaussianCloud alone;
  alone.sh_degree = cloud.sh_degree, alone.extra_stride = cloud.extra_stride;
  scene::append_rows(alone, cloud, part);
  const std::vector<std::uint32_t> not_rest = united(part, hidden);
  render::Layers scene(cloud), rest(cloud);
  scene.hidden = hidden, rest.hidden = not_rest;
  render::ForwardOptions depth_only;
  depth_only.color = false, depth_only.depth = true;
  const std::size_t rows = cloud.size();
  Told told{std::vector<double>(rows), std::vector<double>(rows), std::vector<int>(rows), std::vector<int>(rows)};
  render::Rendering of_part, of_rest;
  for (const scene::Camera& view : views) {
    render::forward(alone, view, depth_only, {}, workspace, of_part);
    render::forward(rest, view, depth_only, {}, workspace, of_rest);
    const scene::Image shown = where_shown(of_part, of_rest);
    render::add_weight_sums(scene, view, shown, workspace, told.light, told.on_part);
    compare_depths(cloud.mean, view, of_part, shown, told.in_front, told.behind);
  }
  return told;
}

/// Does the unedited scene look as it does without these rows?
bool looks_the_same_without(const scene::GaussianCloud& original, std::span<const std::uint32_t> rows,
                            std::span<const scene::Camera> views, render::Workspace& workspace) {
  std::vector<float> chosen(original.size());
  for (const std::uint32_t row : rows) chosen[row] = 1;
  render::Layers without(original);
  without.hidden = rows;
  render::Rendering is, would_be;
  double sum = 0, count = 0;
  for (const scene::Camera& view : views) {
    render::forward(original, view, {}, chosen, workspace, is);
    render::forward(without, view, {}, {}, workspace, would_be);
    for (std::size_t i = 0; i < is.weight.data.size(); ++i) {
      if (double(is.weight.data[i]) < tenth) continue;
      for (int c = 0; c < 3; ++c) sum += std::pow(double(is.color.plane(c)[i]) - double(would_be.color.plane(c)[i]), 2);
      count += 3;
    }
  }
  return sum <= looks_alike * looks_alike * count;
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
  assert(original.size() == working.input_rows());
  std::vector<std::uint32_t> veils;
  if (arrived.empty() || left.empty()) return veils;
  const std::vector<scene::Camera> small = small_ones(views);
  const Told now = told_of(working.cloud(), arrived, working.rows_that_left(), small, workspace);
  const auto lie_before_the_part = [&](std::uint32_t row) {
    return now.in_front[row] > now.behind[row] && now.on_part[row] > most_of_it * now.light[row];
  };
  double of_part = 0;
  for (const std::uint32_t row : arrived) of_part += now.on_part[row];
  const auto are_seen = [&] {
    double of_veils = 0;
    for (const std::uint32_t row : veils) of_veils += now.on_part[row];
    return of_veils > seen_as_veil * (of_part + of_veils);
  };
  for (std::uint32_t row = 0; row < working.input_rows(); ++row)
    if (working::stays(working.role()[row]) && lie_before_the_part(row)) veils.push_back(row);
  if (!are_seen()) return {};
  const Told unedited = told_of(original, left, {}, small, workspace);
  std::erase_if(veils, [&](std::uint32_t row) { return unedited.on_part[row] > was_there * unedited.light[row]; });
  if (!are_seen() || !looks_the_same_without(original, veils, small, workspace)) return {};
  return veils;
}

}  // namespace engine::repair
