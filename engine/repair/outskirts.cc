#include "engine/repair/outskirts.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>

#include "engine/core/rows.h"
#include "engine/mask/mask.h"
#include "engine/neighbours/neighbour_graph.h"
#include "engine/neighbours/point_index.h"
#include "engine/render/forward.h"
#include "engine/render/weight_sums.h"
#include "engine/scene/sh.h"

namespace engine::repair {
namespace {

constexpr std::size_t most_cameras = 48;  // a choice, as the next one
constexpr int side = 320;                 // pixels
constexpr float covered = 0.5f;           // from this opacity of the part on a pixel shows it
constexpr double most_of_it = 0.5;        // of a row's light
// Of the light that a row has without what stays, as much at most is seen, in the picture that shows most of it.
constexpr double hardly_seen = 0.5;
constexpr double least_light = 1;         // pixels of a picture: less says nothing
constexpr int rim_px = 2;                 // outlines are blurred by as much
constexpr std::size_t nearest_asked = 8;  // rows whose mean colour is compared: a choice
// Of the light of the part: what backs it, or sticks out of it, is less than that where nobody would see it. Three toys
// of a capture have 0.3 to 1.4 % and 31 to 125 %; ideal things, which need neither, 0.1 % and up to 7 %.
constexpr double seen_as_backing = 0.002, seen_as_haze = 0.1;

/// What pictures tell: sums of blending weights over their pixels, and numbers of pictures.
struct Told {
  // [rows] Of the scene:
  std::vector<double> light, on_part;  ///< Everywhere, and where the part shows.
  std::vector<int> in_front, behind;   ///< Pictures in which its mean is where the part shows: before it, behind it.
  // [rows of the part] Of the part without the rest:
  std::vector<double> alone, beside;  ///< Everywhere, and beside where the part shows in the scene.
  std::vector<double> shown;          ///< Of the light of one picture, the largest share that the scene shows as well.
};

/// Pixels that the part covers, and in which it is before the rest.
scene::Mask shows_part(const render::Rendering& part, const render::Rendering& rest) {
  scene::Mask shows(part.alpha.width, part.alpha.height);
  for (std::size_t i = 0; i < shows.data.size(); ++i) {
    const float alpha = part.alpha.data[i], behind = rest.median_depth.data[i];
    shows.data[i] = alpha > covered && (behind == 0 || part.depth.data[i] < behind * alpha);
  }
  return shows;
}

/// 1 at the pixels of a mask, or beside it.
scene::Image image_of(const scene::Mask& mask, bool inside) {
  scene::Image image(mask.width, mask.height, 1);
  for (std::size_t i = 0; i < image.data.size(); ++i) image.data[i] = (mask.data[i] != 0) == inside ? 1.0f : 0.0f;
  return image;
}

/// Notes which rows are before the part, and which behind it.
void compare_depths(const Array3& means, const scene::Camera& camera, const render::Rendering& part,
                    const scene::Mask& shows, Told& told) {
  for (std::size_t row = 0; row < means.size(); ++row) {
    const DVec3 p = camera.cam_from_world(means.get(row));
    if (!(p.z > 0)) continue;
    const DVec2 pixel = camera.pixel_from_cam(p);
    if (!(pixel.x >= 0 && pixel.y >= 0 && pixel.x < camera.width && pixel.y < camera.height)) continue;
    const int x = int(pixel.x), y = int(pixel.y);
    if (shows.at(x, y) == 0) continue;
    ++(p.z * double(part.alpha.at(x, y)) < double(part.depth.at(x, y)) ? told.in_front : told.behind)[row];
  }
}

Vec3 color_of(const scene::GaussianCloud& cloud, std::size_t row) {
  const std::size_t stride = scene::sh_coefficients(cloud.sh_degree);
  Vec3 color;
  for (int c = 0; c < 3; ++c) color[c] = 0.5f + float(scene::sh_c0) * cloud.sh_row(row)[std::size_t(c) * stride];
  return color;
}

/// The mean colour of those of `rows` that are nearest to each row of `of`; infinitely far from any where there are
/// none.
std::vector<Vec3> colors_around(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                                std::span<const std::uint32_t> of) {
  const std::size_t asked = std::min(nearest_asked, rows.size());
  std::vector<Vec3> out(of.size(), Vec3(asked > 0 ? 0.0f : std::numeric_limits<float>::infinity()));
  if (asked == 0 || of.empty()) return out;
  const DVec3 origin = cloud.mean.get(of[0]);
  const auto nearest = neighbours::PointIndex(neighbours::points_of(cloud.mean, rows, origin), 3)
                           .nearest(neighbours::points_of(cloud.mean, of, origin), asked);
  for (std::size_t k = 0; k < nearest.size(); ++k)
    out[k / asked] += color_of(cloud, rows[nearest[k].index]) / float(asked);
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
    const Vec3 color = color_of(scene, rows[i]);
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
    told_.light = told_.on_part = std::vector<double>(scene.size());
    told_.in_front = told_.behind = std::vector<int>(scene.size());
    told_.alone = told_.beside = told_.shown = std::vector<double>(part.size());
  }
  Look(const Look&) = delete;
  Look& operator=(const Look&) = delete;

  void from(const scene::Camera& camera) {
    render::forward(alone_, camera, depth_only_, {}, workspace_, of_part_);
    render::forward(rest_, camera, depth_only_, {}, workspace_, of_rest_);
    const scene::Mask shows = shows_part(of_part_, of_rest_);
    if (shows.area() == 0) return;
    std::vector<double> light(scene_.size()), on_part(scene_.size()), alone(part_.size()), beside(part_.size());
    render::add_weight_sums(render::Layers(scene_), camera, image_of(shows, true), workspace_, light, on_part);
    render::add_weight_sums(render::Layers(alone_), camera, image_of(mask::dilate(shows, rim_px), false), workspace_,
                            alone, beside);
    for (std::size_t row = 0; row < light.size(); ++row)
      told_.light[row] += light[row], told_.on_part[row] += on_part[row];
    for (std::size_t i = 0; i < part_.size(); ++i) {
      told_.alone[i] += alone[i], told_.beside[i] += beside[i];
      if (alone[i] >= least_light) told_.shown[i] = std::max(told_.shown[i], light[part_[i]] / alone[i]);
    }
    compare_depths(scene_.mean, camera, of_part_, shows, told_);
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
  Told told_;
};

}  // namespace

Outskirts outskirts_of(const scene::GaussianCloud& scene, std::span<const std::uint32_t> part,
                       std::span<const scene::Camera> cameras) {
  Outskirts out;
  if (part.empty()) return out;
  Look look(scene, part);
  const std::size_t count = std::min(cameras.size(), most_cameras);
  for (std::size_t k = 0; k < count; ++k) look.from(scene::fit_within(cameras[k * cameras.size() / count], side));

  const Told& told = look.told();
  double of_part = 0, of_backing = 0, of_haze = 0;
  for (std::uint32_t row = 0, i = 0; row < scene.size(); ++row) {
    if (i < part.size() && part[i] == row) {
      of_part += told.on_part[row];
      if (told.alone[i] >= least_light && told.shown[i] < hardly_seen && told.beside[i] > most_of_it * told.alone[i])
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
  return out;
}

}  // namespace engine::repair
