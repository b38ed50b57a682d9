#include "engine/repair/thin_plate.h"

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <utility>

#include "engine/core/parallel.h"

namespace engine::repair {
namespace {

// Nodes around the unknown ones whose values tell how the function goes on, and nodes over which those are smoothed:
// choices. What a capture knows of a surface is uneven, and a slope taken from the rim alone would carry that on.
constexpr int reach = 8;
constexpr float stiffness = 4;
constexpr int coarsest = 16;                                // nodes along the longest edge
constexpr int sweeps_on_finest = 60, times_on_coarser = 3;  // an eighth of the nodes, which smooth changes come from
constexpr float over_relaxation = 1.6f;                     // below 2, where it no longer settles: a choice
// Nodes of one colour have no node in common that is next to both, so that they can be relaxed at once: no
// difference of x + 2 y + 3 z between nodes up to two steps apart is a multiple of seven.
constexpr int colors = 7;
constexpr std::size_t nodes_per_task = 4096;  // a choice

/// One resolution of the function.
struct Level {
  GridSize size{};
  std::vector<Knowledge> known;
  std::vector<float> values;
};

/// Every other node of a level.
Level coarser(const Level& fine) {
  Level out;
  for (std::size_t axis = 0; axis < 3; ++axis) out.size[axis] = (fine.size[axis] + 1) / 2;
  const std::size_t nodes = node_index(out.size, 0, 0, out.size[2]);
  out.known.resize(nodes), out.values.resize(nodes);
  for (int z = 0; z < out.size[2]; ++z)
    for (int y = 0; y < out.size[1]; ++y)
      for (int x = 0; x < out.size[0]; ++x) {
        const std::size_t from = node_index(fine.size, 2 * x, 2 * y, 2 * z), to = node_index(out.size, x, y, z);
        out.known[to] = fine.known[from], out.values[to] = fine.values[from];
      }
  return out;
}

/// Nodes at most `by` from a marked one along each axis.
void widen(const GridSize& size, int by, std::vector<std::uint8_t>& marked) {
  const std::array<std::size_t, 3> stride{1, std::size_t(size[0]), std::size_t(size[0]) * std::size_t(size[1])};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t a = (axis + 1) % 3, b = (axis + 2) % 3;
    parallel_for(std::size_t(size[a]), 4, [&](std::size_t begin, std::size_t end) {
      const auto length = std::size_t(size[axis]);
      std::vector<std::uint8_t> line(length);
      for (std::size_t i = begin; i < end; ++i)
        for (std::size_t j = 0; j < std::size_t(size[b]); ++j) {
          std::uint8_t* const first = marked.data() + i * stride[a] + j * stride[b];
          for (std::size_t k = 0; k < line.size(); ++k) line[k] = first[k * stride[axis]];
          int last = -by - 1;  // marked node before this one
          for (int k = 0; k < size[axis]; ++k) {
            if (line[std::size_t(k)] != 0) last = k;
            if (k - last <= by) first[std::size_t(k) * stride[axis]] = 1;
          }
          last = size[axis] + by;
          for (int k = size[axis] - 1; k >= 0; --k) {
            if (line[std::size_t(k)] != 0) last = k;
            if (last - k <= by) first[std::size_t(k) * stride[axis]] = 1;
          }
        }
    });
  }
}

using Offset = std::array<int, 3>;

/// The nodes that the bending at a node and its neighbours depends on: those up to two steps away.
constexpr std::array<Offset, 25> stencil = [] {
  std::array<Offset, 25> out{};
  std::size_t count = 0;
  for (int z = -2; z <= 2; ++z)
    for (int y = -2; y <= 2; ++y)
      for (int x = -2; x <= 2; ++x)
        if (std::max(x, -x) + std::max(y, -y) + std::max(z, -z) <= 2) out[count++] = {x, y, z};
  return out;
}();
constexpr std::uint32_t everywhere = (1u << stencil.size()) - 1;

constexpr std::size_t cell_of(const Offset& by) { return std::size_t(by[0] + 2 + 5 * (by[1] + 2 + 5 * (by[2] + 2))); }
/// A bit for each node of the stencil, by cell_of().
constexpr std::array<std::uint32_t, 125> bits = [] {
  std::array<std::uint32_t, 125> out{};
  for (std::size_t k = 0; k < stencil.size(); ++k) out[cell_of(stencil[k])] = 1u << k;
  return out;
}();

float bounded(float value, Knowledge known) {
  if (known == Knowledge::not_negative) return std::max(value, 0.0f);
  if (known == Knowledge::not_positive) return std::min(value, 0.0f);
  return value;
}

/// Relaxes one level, node by node.
class Relaxation {
 public:
  ///   around  nodes around the unknown ones that are relaxed as well
  ///   pull    weight of what is known, beside that of bending
  Relaxation(Level& level, int around, float pull) : level_(level), pull_(pull), measured_(level.values) {
    const GridSize& size = level.size;
    const auto row = std::ptrdiff_t(size[0]);
    stride_ = {1, row, row * size[1]};
    is_free_.resize(level.known.size());
    for (std::size_t node = 0; node < is_free_.size(); ++node) is_free_[node] = level.known[node] == Knowledge::nothing;
    widen(size, around, is_free_);
    for (int z = 0; z < size[2]; ++z)
      for (int y = 0; y < size[1]; ++y)
        for (int x = 0; x < size[0]; ++x)
          if (const std::size_t node = node_index(size, x, y, z); is_free_[node] != 0)
            places_[std::size_t((x + 2 * y + 3 * z) % colors)].push_back({std::uint32_t(node), around_of({x, y, z})});
  }

  [[nodiscard]] std::span<const std::uint8_t> is_free() const { return is_free_; }  ///< [nodes] Those that are relaxed.
  void run(int sweeps) {
    for (int sweep = 0; sweep < sweeps; ++sweep)
      for (const std::vector<Place>& alike : places_)
        parallel_for(alike.size(), nodes_per_task, [&](std::size_t begin, std::size_t end) {
          for (std::size_t k = begin; k < end; ++k) relax(alike[k]);
        });
  }

 private:
  struct Place {
    std::uint32_t node = 0;
    std::uint32_t around = 0;  ///< Those `bits` whose nodes are relaxed as well.
  };
  /// First and second derivative of what is minimised by the value of one node, but for a factor of 2.
  struct Bending {
    float slope = 0, curvature = 0;
  };

  [[nodiscard]] std::uint32_t around_of(const Offset& at) const {
    std::uint32_t out = 0;
    for (std::size_t k = 0; k < stencil.size(); ++k) {
      Offset there{};
      bool is_inside = true;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        there[axis] = at[axis] + stencil[k][axis];
        is_inside = is_inside && there[axis] >= 0 && there[axis] < level_.size[axis];
      }
      if (is_inside && is_free_[node_index(level_.size, there[0], there[1], there[2])] != 0) out |= 1u << k;
    }
    return out;
  }
  [[nodiscard]] std::ptrdiff_t step(const Offset& by) const {
    return by[0] * stride_[0] + by[1] * stride_[1] + by[2] * stride_[2];
  }

  /// Sets a node to what is least for it alone, and beyond.
  void relax(const Place& place) {
    auto [slope, curvature] = place.around == everywhere ? bending_within(place.node) : bending_at_rim(place);
    float& value = level_.values[place.node];
    const Knowledge known = level_.known[place.node];
    if (known == Knowledge::value) slope += pull_ * (value - measured_[place.node]), curvature += pull_;
    if (!(curvature > 0)) return;  // too few are around for anything to bend
    value = bounded(value - over_relaxation * slope / curvature, known);
  }

  /// Where all of the stencil is relaxed: the biharmonic operator.
  [[nodiscard]] Bending bending_within(std::uint32_t node) const {
    const float* const value = level_.values.data() + node;
    float beside = 0, diagonal = 0, beyond = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::ptrdiff_t u = stride_[a], v = stride_[(a + 1) % 3];
      beside += value[u] + value[-u];
      diagonal += value[u + v] + value[u - v] + value[v - u] + value[-u - v];
      beyond += value[2 * u] + value[-2 * u];
    }
    return {42 * value[0] - 12 * beside + 2 * diagonal + beyond, 42};
  }

  /// Else the sum over those second differences whose nodes are all relaxed.
  [[nodiscard]] Bending bending_at_rim(const Place& place) const {
    const float* const value = level_.values.data() + place.node;
    Bending out;
    const auto is_there = [&](const Offset& by) { return (place.around & bits[cell_of(by)]) != 0; };
    for (std::size_t a = 0; a < 3; ++a)
      for (int middle = -1; middle <= 1; ++middle) {
        Offset before{}, at{}, after{};
        before[a] = middle - 1, at[a] = middle, after[a] = middle + 1;
        if (!is_there(before) || !is_there(at) || !is_there(after)) continue;
        const float difference = value[step(before)] - 2 * value[step(at)] + value[step(after)];
        const float share = middle == 0 ? -2.0f : 1.0f;
        out.slope += share * difference, out.curvature += share * share;
      }
    for (std::size_t a = 0; a < 3; ++a)
      for (const int u : {-1, 1})
        for (const int v : {-1, 1}) {
          Offset first{}, second{}, both{};
          first[a] = both[a] = u, second[(a + 1) % 3] = both[(a + 1) % 3] = v;
          if (!is_there(first) || !is_there(second) || !is_there(both)) continue;
          // Twice: the mixed derivatives of a plate are two.
          out.slope += 2 * (value[0] - value[step(first)] - value[step(second)] + value[step(both)]);
          out.curvature += 2;
        }
    return out;
  }

  Level& level_;
  float pull_;
  std::array<std::ptrdiff_t, 3> stride_{};
  std::vector<float> measured_;
  std::vector<std::uint8_t> is_free_;  ///< Nodes that are relaxed.
  std::array<std::vector<Place>, colors> places_;
};

/// Values between every other node, for those of a finer level that are relaxed and not known.
void refine(const Level& coarse, std::span<const std::uint8_t> is_free, Level& fine) {
  const GridSize& size = fine.size;
  parallel_for(std::size_t(size[2]), 4, [&](std::size_t begin, std::size_t end) {
    for (int z = int(begin); z < int(end); ++z)
      for (int y = 0; y < size[1]; ++y)
        for (int x = 0; x < size[0]; ++x) {
          const std::size_t node = node_index(size, x, y, z);
          const Knowledge known = fine.known[node];
          if (known == Knowledge::value || is_free[node] == 0) continue;
          float sum = 0;
          for (int corner = 0; corner < 8; ++corner) {
            const auto along = [&](int at, int bit, int last) {
              return std::min(at / 2 + ((corner >> bit & 1) != 0 ? at % 2 : 0), last);
            };
            sum += coarse.values[node_index(coarse.size, along(x, 0, coarse.size[0] - 1),
                                            along(y, 1, coarse.size[1] - 1), along(z, 2, coarse.size[2] - 1))];
          }
          fine.values[node] = bounded(sum / 8, known);
        }
  });
}

}  // namespace

void continue_with_least_bending(const GridSize& size, std::span<const Knowledge> known, std::vector<float>& values) {
  assert(known.size() == values.size());
  std::vector<Level> levels;
  levels.push_back({size, {known.begin(), known.end()}, std::move(values)});
  while (std::ranges::max(levels.back().size) > coarsest) levels.push_back(coarser(levels.back()));
  int sweeps = sweeps_on_finest;
  for (std::size_t l = 1; l < levels.size(); ++l) sweeps *= times_on_coarser;
  for (std::size_t l = levels.size(); l-- > 0; sweeps /= times_on_coarser) {
    // Over as many nodes as there are at this resolution values pull as hard as they bend.
    const float over = std::max(stiffness / float(1 << l), 1.0f);
    Relaxation relaxation(levels[l], std::max(reach >> l, 2), 1 / (over * over * over * over));
    if (l + 1 < levels.size()) refine(levels[l + 1], relaxation.is_free(), levels[l]);
    relaxation.run(sweeps);
  }
  values = std::move(levels[0].values);
}

}  // namespace engine::repair
