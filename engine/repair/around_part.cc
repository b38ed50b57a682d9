#include "engine/repair/around_part.h"

#include <algorithm>
#include <cmath>

#include "engine/core/parallel.h"
#include "engine/correct/corrector.h"
#include "engine/render/forward.h"
#include "engine/repair/plane.h"
#include "engine/repair/seed.h"
#include "engine/repair/survey.h"

namespace engine::repair {
namespace {

// Fewer pixels may be an error of the depth at an outline; more of them tell no more than so many.
constexpr std::uint32_t least_pixels = 3, many_pixels = 20;
constexpr std::size_t neighbours_asked = 12;  // they say how a surface lies: a choice
constexpr float farthest = 1e9f;              // of a place, so that squares of distances fit a float

/// Sums over pixels that show one cell of a grid of spacing_around.
struct Cell {
  Vec3 place{0.0f}, color{0.0f};
  std::uint32_t pixels = 0;
};

/// The grid, from the middle of the part: its half extent, and what is around it. 30 MB.
class Grid {
 public:
  Grid() : cells_(std::size_t(side) * side * side) {}
  void add(Vec3 place, Vec3 color) {
    std::size_t at = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const float n = std::floor(place[axis] / spacing_around) + float(half);
      if (!(n >= 0 && n < float(side))) return;
      at = at * side + std::size_t(n);
    }
    cells_[at].place += place, cells_[at].color += color, ++cells_[at].pixels;
  }
  [[nodiscard]] const std::vector<Cell>& cells() const { return cells_; }

 private:
  static constexpr int half = int((0.5f + reach_around) / spacing_around) + 1, side = 2 * half;
  std::vector<Cell> cells_;
};

void add_picture(const scene::Camera& camera, const render::Rendering& shown, const AroundPart& frame, Grid& grid) {
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const double depth = double(shown.median_depth.at(x, y));
      if (!(depth > 0) || shown.alpha.at(x, y) < correct::trusted) continue;
      Vec3 color;
      for (int c = 0; c < 3; ++c) color[c] = std::clamp(shown.color.at(x, y, c), 0.0f, 1.0f);
      grid.add(frame.place_of(point_at(camera, {x + 0.5, y + 0.5}, 1 / depth)), color);
    }
}

/// A point for each cell that enough pixels show.
void gather(const Grid& grid, AroundPart& out) {
  for (const Cell& cell : grid.cells()) {
    if (cell.pixels < least_pixels) continue;
    const auto count = float(cell.pixels);
    for (int axis = 0; axis < 3; ++axis) out.place.push_back(cell.place[axis] / count);
    out.color.push_back(cell.color / count);
    out.weight.push_back(float(std::min(cell.pixels, many_pixels)) / float(many_pixels));
  }
}

std::vector<Vec3> normals_of(const AroundPart& around) {
  const std::size_t asked = std::min(neighbours_asked, around.size());
  const auto nearest = around.index->nearest(around.place, asked);
  std::vector<Vec3> normals(around.size());
  parallel_for(around.size(), 256, [&](std::size_t begin, std::size_t end) {
    std::vector<DVec3> beside(asked);
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t k = 0; k < asked; ++k) beside[k] = around.at(nearest[i * asked + k].index);
      normals[i] = plane_of(beside).normal;
    }
  });
  return normals;
}

}  // namespace

Vec3 AroundPart::place_of(DVec3 point) const {
  const DVec3 apart = (point - middle) / extent;
  return Vec3(glm::clamp(apart, DVec3(-double(farthest)), DVec3(double(farthest))));
}

std::vector<float> AroundPart::places_of(std::span<const DVec3> points) const {
  std::vector<float> places;
  places.reserve(3 * points.size());
  for (const DVec3& point : points) {
    const Vec3 at_point = place_of(point);
    for (int axis = 0; axis < 3; ++axis) places.push_back(at_point[axis]);
  }
  return places;
}

Result<AroundPart> look_around(const scene::GaussianCloud& scene, std::span<const std::uint32_t> part,
                               std::span<const scene::Camera> cameras,
                               const std::function<Result<void>(double)>& looked) {
  AroundPart out;
  if (part.empty()) return out;
  const Bounds box = most_of(scene, part);
  out.middle = (box.low + box.high) / 2.0;
  out.extent = glm::length(box.high - box.low);
  if (!(out.extent > 0)) return out;

  render::Layers layers(scene);
  layers.hidden = part;
  render::ForwardOptions options;
  options.depth = true;
  render::Workspace workspace;
  render::Rendering shown;
  Grid grid;
  const std::size_t count = std::min(cameras.size(), cameras_around);
  for (std::size_t k = 0; k < count; ++k) {
    const scene::Camera camera = scene::fit_within(cameras[k * cameras.size() / count], side_around);
    render::forward(layers, camera, options, {}, workspace, shown);
    add_picture(camera, shown, out, grid);
    if (auto going = looked(double(k + 1) / double(count)); !going) return propagate(going);
  }
  gather(grid, out);
  if (out.size() == 0) return out;
  out.index.emplace(out.place, 3);
  out.normal = normals_of(out);

  std::vector<DVec3> means;
  for (const std::uint32_t row : part) {
    const DVec3 mean(scene.mean.get(row));
    if (glm::any(glm::lessThan(mean, box.low)) || glm::any(glm::greaterThan(mean, box.high))) continue;
    means.push_back(mean);
  }
  out.distance.assign(out.size(), reach_around);
  if (means.empty()) return out;
  const auto nearest = neighbours::PointIndex(out.places_of(means), 3).nearest(out.place, 1);
  for (std::size_t i = 0; i < out.size(); ++i) out.distance[i] = std::sqrt(nearest[i].squared_distance);
  return out;
}

}  // namespace engine::repair
