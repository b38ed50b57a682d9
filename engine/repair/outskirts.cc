#include "engine/repair/outskirts.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>

#include "engine/core/rows.h"
#include "engine/mask/mask.h"
#include "engine/neighbours/neighbour_graph.h"
#include "engine/render/forward.h"
#include "engine/render/weight_sums.h"
#include "engine/repair/part_shown.h"
#include "engine/repair/spots.h"
#include "engine/repair/survey.h"
#include "engine/scene/base_color.h"

namespace engine::repair {
namespace {

constexpr double most_of_it = 0.5;  // of a row's light
// Of the light that a row has without what stays, less than so much is seen, in the picture that shows most of it.
constexpr double hardly_seen = 0.5;
// Pixels, over all pictures: less says nothing of a row; and in one picture: shares of less are noise. In scenes of
// millions of rows few have a pixel to themselves.
constexpr double least_light = 1, trace_of_light = 0.05;
constexpr int rim_px = 2;                 // a choice: outlines are blurred
constexpr std::size_t nearest_asked = 8;  // rows whose mean colour is compared: a choice
// Of the part's light where it shows: what backs it has less, or what would stick out of it, where nobody would see it.
// Three toys of a capture have 0.3 to 1.4 % and 31 to 125 %; captured cases, which need neither, 0.5 and 9 % at most.
constexpr double seen_as_backing = 0.002, seen_as_haze = 0.1;
// Part of a row's light that falls on pixels of the part, from which on its colour was learnt through the part's
// outline. From 0.02 to 0.05 captured cases are alike.
constexpr double seen_through = 0.05;

// Of the diagonal of the part's box, up to which a row's longest axis may be: one that spans a floor has little of its
// colour from an outline. With 0.6 captured cases are as without; with 0.25 a pouf's place is 0.15 dB worse.
constexpr double most_wide = 0.6;

/// Diagonal of the box that holds nearly all of these rows, world units.
double extent_of(const scene::GaussianCloud& scene, std::span<const std::uint32_t> rows) {
  const Bounds most = most_of(scene, rows);
  return glm::distance(DVec3(most.low), DVec3(most.high));
}

/// What pictures tell: sums of blending weights over their pixels, and numbers of pictures.
struct Told {
  // [rows] Of the scene:
  std::vector<double> light, on_part;  ///< Everywhere, and where the part shows.
  std::vector<int> in_front, behind;   ///< Pictures in which its mean is where the part shows: before it, behind it.
  // [rows of the part] Of the part without the rest:
  std::vector<double> alone, beside;  ///< Everywhere, and beside where the part shows in the scene.
  std::vector<double> shown;  ///< Of the light of one picture, the largest share that the scene shows as well; -1: none
                              ///< shows enough of it to tell.
};

/// What is beside these pixels, and not so near that outlines blur it; 1, else 0. [1]
scene::Image beside(const scene::Image& shown) {
  scene::Mask mask(shown.width, shown.height);
  for (std::size_t i = 0; i < mask.data.size(); ++i) mask.data[i] = shown.data[i] != 0;
  mask = mask::dilate(mask, rim_px);
  scene::Image out(shown.width, shown.height, 1);
  for (std::size_t i = 0; i < out.data.size(); ++i) out.data[i] = mask.data[i] == 0 ? 1.0f : 0.0f;
  return out;
}

/// The mean colour of those of `rows` that are nearest to each row of `of`; infinitely far from any where there are
/// none.
std::vector<Vec3> colors_around(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                                std::span<const std::uint32_t> of) {
  const std::size_t asked = std::min(nearest_asked, rows.size());
  std::vector<Vec3> out(of.size(), Vec3(asked > 0 ? 0.0f : std::numeric_limits<float>::infinity()));
  const std::vector<std::uint32_t> nearest = neighbours::nearest_rows(cloud.mean, rows, of, asked);
  for (std::size_t k = 0; k < nearest.size(); ++k)
    out[k / asked] += scene::base_color(cloud, nearest[k]) / float(asked);
  return out;
}

/// Those of some rows that have rather the colour of the part than of what else is seen around them: what is seen of a
/// wall through a thing may be a wall.
std::vector<std::uint32_t> of_the_colour(const scene::GaussianCloud& scene, std::span<const std::uint32_t> part,
                                         std::vector<std::uint32_t> rows, const std::vector<double>& light) {
  if (rows.empty()) return rows;
  std::vector<std::uint32_t> rest;
  for (std::uint32_t row = 0; row < scene.size(); ++row)
    if (light[row] >= least_light && !std::ranges::binary_search(part, row) && !std::ranges::binary_search(rows, row))
      rest.push_back(row);
  const std::vector<Vec3> of_part = colors_around(scene, part, rows), of_rest = colors_around(scene, rest, rows);
  std::vector<std::uint32_t> out;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Vec3 color = scene::base_color(scene, rows[i]);
    if (glm::distance(color, of_part[i]) < glm::distance(color, of_rest[i])) out.push_back(rows[i]);
  }
  return out;
}

/// Adds what one picture tells.
class Look {
 public:
  Look(const scene::GaussianCloud& scene, std::span<const std::uint32_t> part)
      : scene_(scene), part_(part), alone_(scene::gather(scene, part)), rest_(scene) {
    rest_.hidden = part;
    depth_only_.color = false, depth_only_.depth = true;
    light_ = told_.light = told_.on_part = std::vector<double>(scene.size());
    told_.in_front = told_.behind = std::vector<int>(scene.size());
    alone_light_ = told_.alone = told_.beside = std::vector<double>(part.size());
    told_.shown = std::vector<double>(part.size(), -1.0);
  }
  Look(const Look&) = delete;
  Look& operator=(const Look&) = delete;

  void from(const scene::Camera& camera) {
    render::forward(alone_, camera, depth_only_, {}, workspace_, of_part_);
    render::forward(rest_, camera, depth_only_, {}, workspace_, of_rest_);
    const scene::Image shown = where_shown(of_part_, of_rest_);
    if (std::ranges::count(shown.data, 1.0f) == 0) return;
    for (std::vector<double>* sums : {&light_, &alone_light_}) std::ranges::fill(*sums, 0.0);
    render::add_weight_sums(render::Layers(scene_), camera, shown, workspace_, light_, told_.on_part);
    render::add_weight_sums(render::Layers(alone_), camera, beside(shown), workspace_, alone_light_, told_.beside);
    for (std::size_t row = 0; row < light_.size(); ++row) told_.light[row] += light_[row];
    for (std::size_t i = 0; i < part_.size(); ++i) {
      told_.alone[i] += alone_light_[i];
      if (alone_light_[i] >= trace_of_light)
        told_.shown[i] = std::max(told_.shown[i], light_[part_[i]] / alone_light_[i]);
    }
    compare_depths(scene_.mean, camera, of_part_, shown, told_.in_front, told_.behind);
  }
  [[nodiscard]] const Told& told() const { return told_; }

 private:
  const scene::GaussianCloud& scene_;
  std::span<const std::uint32_t> part_;
  scene::GaussianCloud alone_;
  render::Layers rest_;
  render::ForwardOptions depth_only_;
  render::Workspace workspace_;
  render::Rendering of_part_, of_rest_;
  std::vector<double> light_, alone_light_;  ///< Of one picture: [rows], [rows of the part].
  Told told_;
};

}  // namespace

Result<Outskirts> outskirts_of(const scene::GaussianCloud& scene, std::span<const std::uint32_t> part,
                               std::span<const scene::Camera> cameras,
                               const std::function<Result<void>(double)>& looked) {
  Outskirts out;
  if (part.empty()) return out;
  Look look(scene, part);
  const std::size_t count = std::min(cameras.size(), outskirts_cameras);
  for (std::size_t k = 0; k < count; ++k) {
    look.from(scene::fit_within(cameras[k * cameras.size() / count], outskirts_side));
    if (auto going = looked(double(k + 1) / double(count)); !going) return propagate(going);
  }

  const Told& told = look.told();
  double of_part = 0, of_backing = 0, of_haze = 0;
  for (std::uint32_t row = 0, i = 0; row < scene.size(); ++row) {
    if (i < part.size() && part[i] == row) {
      of_part += told.on_part[row];
      if (told.alone[i] >= least_light && told.shown[i] >= 0 && told.shown[i] < hardly_seen &&
          told.beside[i] > most_of_it * told.alone[i])
        out.buried.push_back(row), of_haze += told.beside[i];
      ++i;
    } else if (told.light[row] >= least_light && told.on_part[row] > most_of_it * told.light[row] &&
               told.behind[row] > told.in_front[row]) {
      out.backing.push_back(row);
    }
  }
  out.backing = of_the_colour(scene, part, std::move(out.backing), told.light);
  for (const std::uint32_t row : out.backing) of_backing += told.on_part[row];
  if (of_backing < seen_as_backing * of_part) out.backing.clear();
  if (of_haze < seen_as_haze * of_part) out.buried.clear();

  const double widest = most_wide * extent_of(scene, part);
  for (std::uint32_t row = 0; row < scene.size(); ++row) {
    if (told.light[row] < least_light || told.in_front[row] > told.behind[row] ||
        std::ranges::binary_search(part, row) || std::ranges::binary_search(out.backing, row))
      continue;
    if (told.on_part[row] <= seen_through * told.light[row])
      out.clear.push_back(row);
    else if (longest_axis(scene, row) < widest)
      out.through.push_back(row);
  }
  return out;
}

}  // namespace engine::repair
