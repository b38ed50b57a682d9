#include "engine/procedural/occluders.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace engine::procedural {

Occluders::Occluders(std::span<const Object> objects) {
  std::uint32_t number = 0;
  for (const Object& object : objects)
    for (const Patch& patch : object.patches) {
      auto at = [&](int i, int j) {
        return object.placement.world(patch.position(float(i) / float(patch.cells_u), float(j) / float(patch.cells_v)));
      };
      for (int j = 0; j < patch.cells_v; ++j)
        for (int i = 0; i < patch.cells_u; ++i) {
          const Vec3 a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
          triangles_.push_back({a, b - a, c - a, number});
          triangles_.push_back({a, c - a, d - a, number});
        }
      ++number;
    }
  nodes_.reserve(2 * triangles_.size() + 1);
  nodes_.emplace_back();
  split(0, 0, std::uint32_t(triangles_.size()));
}

namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

struct Box {
  Vec3 low{infinity}, high{-infinity};
  void add(Vec3 p) { low = glm::min(low, p), high = glm::max(high, p); }
  void add(const Box& other) { low = glm::min(low, other.low), high = glm::max(high, other.high); }
  [[nodiscard]] float half_area() const {
    const Vec3 size = high - low;
    return size.x * size.y + size.y * size.z + size.z * size.x;
  }
};

}  // namespace

/// Triangles are cut in two between two of 16 bins along an axis.
struct Occluders::Cut {
  static constexpr std::size_t bins = 16;

  int axis = -1;        ///< -1: no cut.
  std::size_t bin = 0;  ///< The first one of the second half.
  Vec3 low{}, size{};   ///< Box of the triangles' middles.

  [[nodiscard]] static Vec3 middle(const Triangle& t) { return t.corner + (t.edge1 + t.edge2) / 3.0f; }
  [[nodiscard]] static Box box_of(const Triangle& t) {
    Box box;
    box.add(t.corner), box.add(t.corner + t.edge1), box.add(t.corner + t.edge2);
    return box;
  }
  [[nodiscard]] std::size_t bin_of(const Triangle& t, int across) const {
    return std::min(bins - 1, std::size_t((middle(t)[across] - low[across]) / size[across] * float(bins)));
  }
  [[nodiscard]] bool is_before(const Triangle& t) const { return bin_of(t, axis) < bin; }
};

Occluders::Cut Occluders::best_cut(std::span<const Triangle> triangles, Vec3 low, Vec3 high, float unsplit) {
  Cut best{.low = low, .size = high - low};
  float best_cost = unsplit;  // of a half: its box's surface area times its triangles
  for (int axis = 0; axis < 3; ++axis) {
    if (!(best.size[axis] > 0)) continue;
    std::array<Box, Cut::bins> boxes;
    std::array<std::uint32_t, Cut::bins> counts{};
    for (const Triangle& triangle : triangles) {
      const std::size_t bin = best.bin_of(triangle, axis);
      boxes[bin].add(Cut::box_of(triangle));
      ++counts[bin];
    }
    std::array<float, Cut::bins> cost_right{};  // of everything from a bin on
    Box right;
    std::uint32_t count = 0;
    for (std::size_t bin = Cut::bins; bin-- > 1;) {
      right.add(boxes[bin]);
      count += counts[bin];
      cost_right[bin] = count > 0 ? right.half_area() * float(count) : 0.0f;
    }
    Box left;
    count = 0;
    for (std::size_t bin = 1; bin < Cut::bins; ++bin) {
      left.add(boxes[bin - 1]);
      count += counts[bin - 1];
      if (count == 0 || count == triangles.size()) continue;
      const float cost = left.half_area() * float(count) + cost_right[bin];
      if (cost < best_cost) best_cost = cost, best.axis = axis, best.bin = bin;
    }
  }
  return best;
}

void Occluders::split(std::uint32_t node, std::uint32_t begin, std::uint32_t end) {
  const std::span triangles(triangles_.data() + begin, end - begin);
  Box box, middles;
  for (const Triangle& triangle : triangles) box.add(Cut::box_of(triangle)), middles.add(Cut::middle(triangle));
  constexpr float skin = 1e-5f;  // so that rounding never makes a ray miss the box of a flat, axis-aligned triangle
  nodes_[node].low = box.low - skin;
  nodes_[node].high = box.high + skin;
  nodes_[node].first = begin;
  nodes_[node].count = end - begin;
  if (end - begin <= 4) return;
  const Cut cut = best_cut(triangles, middles.low, middles.high, box.half_area() * float(end - begin));
  if (cut.axis < 0) return;
  const auto second = std::partition(triangles.begin(), triangles.end(),
                                     [&](const Triangle& triangle) { return cut.is_before(triangle); });
  const std::uint32_t half = begin + std::uint32_t(second - triangles.begin());
  const auto children = std::uint32_t(nodes_.size());
  nodes_[node].first = children;
  nodes_[node].count = 0;
  nodes_.emplace_back();
  nodes_.emplace_back();
  split(children, begin, half);
  split(children + 1, half, end);
}

template <bool any_hit>
std::optional<Hit> Occluders::cast(Vec3 origin, Vec3 direction, float limit) const {
  const Vec3 inverse = 1.0f / direction;  // infinite for a zero component, which the slab test copes with
  auto entry = [&](const Node& node) {    // distance at which the ray enters the box; infinity if it misses
    float enter = 0, leave = limit;
    for (int axis = 0; axis < 3; ++axis) {
      const float a = (node.low[axis] - origin[axis]) * inverse[axis];
      const float b = (node.high[axis] - origin[axis]) * inverse[axis];
      enter = std::max(enter, std::min(a, b));
      leave = std::min(leave, std::max(a, b));
    }
    return enter <= leave ? enter : infinity;
  };
  struct Task {
    std::uint32_t node;
    float entry;
  };
  std::optional<Hit> best;
  std::array<Task, 128> stack;  // one sibling per level; split() needs far fewer levels for any scene of this room
  std::size_t depth = 0;
  stack[depth++] = {0, entry(nodes_[0])};
  while (depth > 0) {
    const Task task = stack[--depth];
    if (task.entry >= limit) continue;
    const Node& node = nodes_[task.node];
    if (node.count == 0 && node.first != 0) {
      const Task left{node.first, entry(nodes_[node.first])};
      const Task right{node.first + 1, entry(nodes_[node.first + 1])};
      const bool left_first = left.entry <= right.entry;
      stack[depth++] = left_first ? right : left;
      stack[depth++] = left_first ? left : right;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Triangle& t = triangles_[i];
      const Vec3 p = glm::cross(direction, t.edge2);
      const float determinant = glm::dot(t.edge1, p);
      if (std::abs(determinant) < 1e-14f) continue;  // edge-on, or a triangle of no area (at a pole)
      const Vec3 from = origin - t.corner, q = glm::cross(from, t.edge1);
      const float u = glm::dot(from, p) / determinant, v = glm::dot(direction, q) / determinant;
      const float distance = glm::dot(t.edge2, q) / determinant;
      if (u < 0 || v < 0 || u + v > 1 || distance <= 0 || distance >= limit) continue;
      best = Hit{distance, t.patch};
      if (any_hit) return best;
      limit = distance;
    }
  }
  return best;
}

bool Occluders::any(Vec3 origin, Vec3 direction, float limit) const {
  return cast<true>(origin, direction, limit).has_value();
}
std::optional<Hit> Occluders::nearest(Vec3 origin, Vec3 direction, float limit) const {
  return cast<false>(origin, direction, limit);
}

}  // namespace engine::procedural
