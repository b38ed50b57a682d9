#include "engine/repair/closure.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/repair/thin_plate.h"
#include "engine/scene/in_picture.h"

namespace engine::repair {
namespace {

constexpr int most_nodes = 112;         // along the longest edge: a choice
constexpr double wider = 0.5;           // extents of what has left, added on each side: what is around shows there
constexpr float band = 3;               // steps from a surface within which its distance is known
constexpr double solid = 0.25;          // of the grid: so far behind a surface is its inside, farther is unknown
constexpr double hidden_behind = 0.01;  // of the distance: depths of splats are no finer

/// What views know of one node.
struct Known {
  double sum = 0;  ///< Of the function, as each view that shows it has it.
  int seen = 0, behind = 0;
  Vec3 color{0.0f};  ///< Sum over the views that show a surface there, beside the part.
  int near = 0;
};

/// Adds what a view tells of a node.
///   p      the node, in the view's frame
///   width  of what is known on either side of a surface, world units
///   deep   of what is inside behind it, world units
void add(const SpaceView& view, DVec3 p, double width, double deep, Known& known) {
  const auto pixel = pixel_in_picture(view.camera, p);
  if (!pixel) return;
  const int x = int(pixel->x), y = int(pixel->y);
  const double surface = double(view.known.at(x, y)), before = double(view.before.at(x, y));
  if (!(surface > 0)) {
    if (!(before > 0) || p.z < before * (1 - hidden_behind)) known.sum += 1, ++known.seen;
    return;
  }
  const double ahead = surface - p.z;
  if (ahead >= -width)
    known.sum += std::min(ahead / width, 1.0), ++known.seen;
  else if (ahead >= -deep)
    ++known.behind;
  if (std::abs(ahead) <= width && view.left.at(x, y) == 0)
    known.color += Vec3(view.color.at(x, y, 0), view.color.at(x, y, 1), view.color.at(x, y, 2)), ++known.near;
}

/// Adds what a view tells of a row of nodes, a line in its picture.
///   first, step  the first node and the way from one to the next, world units
void add(const SpaceView& view, DVec3 first, DVec3 step, double width, double deep, std::span<Known> row) {
  const DVec3 p = view.camera.cam_from_world(first), along = view.camera.rotation * step;
  for (std::size_t x = 0; x < row.size(); ++x) add(view, p + double(x) * along, width, deep, row[x]);
}

}  // namespace

Closure::Closure(const Bounds& space, std::span<const SpaceView> views) {
  const DVec3 extent = space.high - space.low;
  const double longest = std::max({extent.x, extent.y, extent.z});
  if (!(longest > 0)) return;
  extent_ = longest;
  low_ = space.low - DVec3(wider * longest);
  step_ = (1 + 2 * wider) * longest / (most_nodes - 1);
  for (int axis = 0; axis < 3; ++axis)
    size_[std::size_t(axis)] = int(std::ceil((extent[axis] + 2 * wider * longest) / step_)) + 1;
  const std::size_t nodes = node_index(size_, 0, 0, size_[2]);
  value_.assign(nodes, band), color_.assign(nodes, Vec3(0.0f)), colored_.assign(nodes, 0);
  const std::vector<Knowledge> known = note(views);
  measure_across(known);
  continue_with_least_bending(size_, known, value_);
  spread_colors();
}

std::size_t Closure::index(const GridSize& node) const { return node_index(size_, node[0], node[1], node[2]); }

std::vector<Knowledge> Closure::note(std::span<const SpaceView> views) {
  const double width = double(band) * step_, deep = solid * most_nodes * step_;
  std::vector<Knowledge> knowledge(value_.size(), Knowledge::nothing);
  parallel_for(std::size_t(size_[2]), 1, [&](std::size_t begin, std::size_t end) {
    std::vector<Known> row(static_cast<std::size_t>(size_[0]));
    for (int z = int(begin); z < int(end); ++z)
      for (int y = 0; y < size_[1]; ++y) {
        std::ranges::fill(row, Known{});
        // View by view, so that pixels of a picture are read one after another.
        for (const SpaceView& view : views)
          add(view, low_ + step_ * DVec3(0, y, z), DVec3(step_, 0, 0), width, deep, row);
        for (int x = 0; x < size_[0]; ++x) {
          const Known& known = row[std::size_t(x)];
          const std::size_t node = index({x, y, z});
          // What one view shows counts for more than that others have something before it.
          if (known.seen > 0) {
            value_[node] = band * float(known.sum / known.seen);
            knowledge[node] = value_[node] < band ? Knowledge::value : Knowledge::not_negative;
          } else if (known.behind > 0) {
            value_[node] = -band, knowledge[node] = Knowledge::not_positive;
          }
          if (known.near > 0) color_[node] = known.color / float(known.near), colored_[node] = 1;
        }
      }
  });
  return knowledge;
}

/// Distances along rays become distances to the surface: else it would count more the more it is seen at a slant.
void Closure::measure_across(std::span<const Knowledge> known) {
  const std::vector<float> along = value_;
  const std::array<std::size_t, 3> step{index({1, 0, 0}), index({0, 1, 0}), index({0, 0, 1})};
  parallel_for(std::size_t(size_[2]), 4, [&](std::size_t begin, std::size_t end) {
    for (int z = int(begin); z < int(end); ++z)
      for (int y = 0; y < size_[1]; ++y)
        for (int x = 0; x < size_[0]; ++x) {
          const GridSize at{x, y, z};
          const std::size_t node = index(at);
          if (known[node] != Knowledge::value) continue;
          float square = 0;
          for (std::size_t axis = 0; axis < 3; ++axis) {
            const bool before = at[axis] > 0 && known[node - step[axis]] == Knowledge::value;
            const bool after = at[axis] + 1 < size_[axis] && known[node + step[axis]] == Knowledge::value;
            if (!before && !after) continue;
            const float change = along[after ? node + step[axis] : node] - along[before ? node - step[axis] : node];
            const float slope = before && after ? change / 2 : change;
            square += slope * slope;
          }
          value_[node] = along[node] / std::sqrt(std::max(square, 1.0f));
        }
  });
}

/// Colours at one resolution.
struct Closure::Level {
  GridSize size{};
  std::vector<Vec3> color;
  std::vector<float> weight;  ///< 0: none is known.
};

/// Nodes without a colour get that of the nodes around, as far around as there is one.
/// Source: Gortler et al. 1996, "The lumigraph", section 3.4.2 (push and pull).
void Closure::spread_colors() {
  const auto for_each_node = [](const GridSize& size, auto&& work) {
    for (int z = 0; z < size[2]; ++z)
      for (int y = 0; y < size[1]; ++y)
        for (int x = 0; x < size[0]; ++x) work(x, y, z);
  };
  std::vector<Level> levels;
  levels.push_back({size_, std::move(color_), std::vector<float>(colored_.begin(), colored_.end())});
  while (std::ranges::max(levels.back().size) > 1) {
    const Level& fine = levels.back();
    Level coarse;
    for (std::size_t axis = 0; axis < 3; ++axis) coarse.size[axis] = (fine.size[axis] + 1) / 2;
    coarse.color.assign(node_index(coarse.size, 0, 0, coarse.size[2]), Vec3(0.0f));
    coarse.weight.assign(coarse.color.size(), 0.0f);
    for_each_node(fine.size, [&](int x, int y, int z) {
      const std::size_t from = node_index(fine.size, x, y, z), to = node_index(coarse.size, x / 2, y / 2, z / 2);
      coarse.color[to] += fine.weight[from] * fine.color[from], coarse.weight[to] += fine.weight[from];
    });
    for (std::size_t node = 0; node < coarse.color.size(); ++node)
      if (coarse.weight[node] > 0) {
        coarse.color[node] /= coarse.weight[node];
        coarse.weight[node] = std::min(coarse.weight[node], 1.0f);
      }
    levels.push_back(std::move(coarse));
  }
  for (std::size_t l = levels.size() - 1; l-- > 0;) {
    Level &fine = levels[l], &coarse = levels[l + 1];
    for_each_node(fine.size, [&](int x, int y, int z) {
      const std::size_t node = node_index(fine.size, x, y, z);
      const Vec3 around = coarse.color[node_index(coarse.size, x / 2, y / 2, z / 2)];
      fine.color[node] = fine.weight[node] * fine.color[node] + (1 - fine.weight[node]) * around;
    });
  }
  color_ = std::move(levels[0].color);
}

Closure::Cell Closure::cell_of(DVec3 point) const {
  const DVec3 at = (point - low_) / step_;
  Cell cell;
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t a = std::size_t(axis);
    cell.node[a] = int(std::clamp(at[axis], 0.0, double(size_[a] - 2)));
    cell.part[axis] = std::clamp(at[axis] - cell.node[a], 0.0, 1.0);
  }
  return cell;
}

template <class Value>
Value Closure::interpolated(const std::vector<Value>& values, DVec3 point) const {
  const Cell cell = cell_of(point);
  Value sum(0);
  for (int corner = 0; corner < 8; ++corner) {
    double weight = 1;
    GridSize node = cell.node;
    for (int axis = 0; axis < 3; ++axis) {
      const bool is_far = (corner >> axis & 1) != 0;
      weight *= is_far ? cell.part[axis] : 1 - cell.part[axis];
      node[std::size_t(axis)] += is_far;
    }
    sum += float(weight) * values[index(node)];
  }
  return sum;
}

double Closure::inverse_depth_at(const scene::Camera& camera, DVec2 pixel, double from) const {
  if (value_.empty()) return 0;
  const DVec3 eye = camera.centre();
  const DVec3 ray =
      camera.world_from_cam({(pixel.x - camera.cx) / camera.fx, (pixel.y - camera.cy) / camera.fy, 1}) - eye;
  double begin = std::max(from, 0.0), end = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double low = low_[axis] - eye[axis], high = low + step_ * (size_[std::size_t(axis)] - 1);
    if (ray[axis] == 0) {  // it runs along this pair of sides
      if (low > 0 || high < 0) return 0;
      continue;
    }
    begin = std::max(begin, std::min(low / ray[axis], high / ray[axis]));
    end = std::min(end, std::max(low / ray[axis], high / ray[axis]));
  }
  const double stride = 0.5 * step_ / glm::length(ray);
  double before = 0;  // the function one stride ago
  for (int k = 0; begin + k * stride < end; ++k) {
    const double z = begin + k * stride, value = double(interpolated(value_, eye + z * ray));
    if (value < 0 && k == 0) return begin == from && from > 0 ? 1 / from : 0;  // else it comes from beyond the grid
    if (value < 0) return 1 / (z - stride * value / (value - before));
    before = value;
  }
  return 0;
}

Vec3 Closure::color_at(DVec3 point) const { return value_.empty() ? Vec3(0.0f) : interpolated(color_, point); }

}  // namespace engine::repair
