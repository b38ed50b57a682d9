#include "engine/repair/thin_plate.h"

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/repair/relaxation.h"

namespace engine::repair {
namespace {

// Nodes around the unknown ones whose values tell how the function goes on, and nodes over which those are smoothed:
// choices. What a capture knows of a surface is uneven, and a slope taken from the rim alone would carry that on.
constexpr int reach = 8;
constexpr float stiffness = 4;
constexpr int coarsest = 16;                                // nodes along the longest edge
constexpr int sweeps_on_finest = 60, times_on_coarser = 3;  // an eighth of the nodes, which smooth changes come from

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

float bounded(float value, Knowledge known) {
  if (known == Knowledge::not_negative) return std::max(value, 0.0f);
  if (known == Knowledge::not_positive) return std::min(value, 0.0f);
  return value;
}

/// Nodes that are relaxed: the unknown ones, and those at most `around` from one along each axis.
std::vector<std::uint8_t> free_nodes(const Level& level, int around) {
  std::vector<std::uint8_t> out(level.known.size());
  std::ranges::transform(level.known, out.begin(), [](Knowledge known) { return known == Knowledge::nothing; });
  widen(level.size, around, out);
  return out;
}

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
    const std::vector<std::uint8_t> is_free = free_nodes(levels[l], std::max(reach >> l, 2));
    if (l + 1 < levels.size()) refine(levels[l + 1], is_free, levels[l]);
    relax(levels[l].size, levels[l].known, is_free, 1 / (over * over * over * over), sweeps, levels[l].values);
  }
  values = std::move(levels[0].values);
}

}  // namespace engine::repair
