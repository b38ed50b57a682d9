#include "engine/repair/relaxation.h"

#include <algorithm>
#include <cassert>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/repair/relaxation_simd.h"

namespace engine::repair {
namespace {

// Nodes of one colour have no node in common that is next to both, so that they can be relaxed at once: no
// difference of x + 2 y + 3 z between nodes up to two steps apart is a multiple of seven.
constexpr std::size_t colors = 7;
constexpr std::size_t blocks_per_task = 256;  // a choice

constexpr std::size_t rounded_up(std::size_t n, std::size_t to) { return (n + to - 1) / to * to; }

/// How nodes are numbered, and where their values are. A step along an axis changes the number by the same everywhere,
/// and a colour has the numbers that are alike modulo seven: rows and planes are padded for that, by two nodes at
/// least, and so is the whole, so that no stencil leaves it. Values of one colour are in a row, in the order of their
/// numbers, and so are those of the nodes that lie the same way from them: vectors are loaded as they are.
struct Layout {
  explicit Layout(const GridSize& size) {
    const auto padded = [](std::size_t n, std::size_t color) { return rounded_up(n - color, colors) + color; };
    row = padded(std::size_t(size[0]) + 2, 2);
    plane = padded(row * (std::size_t(size[1]) + 2), 3);
    first = rounded_up(2 * plane, colors) + block * colors;
    per_color = rounded_up((2 * first + plane * std::size_t(size[2])) / colors, block);
    std::ranges::transform(stencil, steps.begin(), [this](const Offset& by) {
      return by[0] + by[1] * std::ptrdiff_t(row) + by[2] * std::ptrdiff_t(plane);
    });
  }

  [[nodiscard]] std::size_t number(int x, int y, int z) const {
    return first + std::size_t(x) + row * std::size_t(y) + plane * std::size_t(z);
  }
  [[nodiscard]] std::size_t place(std::size_t number) const { return number % colors * per_color + number / colors; }
  /// The number of a node of its stencil.
  [[nodiscard]] std::size_t beside(std::size_t number, std::size_t k) const {
    return std::size_t(std::ptrdiff_t(number) + steps[k]);
  }

  std::size_t row = 0, plane = 0;  ///< Steps along y and z.
  std::size_t first = 0;           ///< Number of the first node, of colour 0.
  std::size_t per_color = 0;
  std::array<std::ptrdiff_t, stencil.size()> steps{};  ///< Along the stencil.
};

/// Calls work(node, number of it) for all nodes, planes at once.
template <class Work>
void for_each_node(const GridSize& size, const Layout& layout, const Work& work) {
  parallel_for(std::size_t(size[2]), 4, [&](std::size_t begin, std::size_t end) {
    for (int z = int(begin); z < int(end); ++z)
      for (int y = 0; y < size[1]; ++y)
        for (int x = 0; x < size[0]; ++x) work(node_index(size, x, y, z), layout.number(x, y, z));
  });
}

/// Those differences that count at a node, and half their second derivative.
///   is_there  [stencil] Free
Rule differences(const std::array<bool, stencil.size()>& is_there) {
  Rule out = 0, bit = 1, curvature = 0;
  for (const StraightDifference& of : straight_differences) {
    if (is_there[of.before] && is_there[of.at] && is_there[of.after])
      out |= bit, curvature += Rule(of.share * of.share);
    bit <<= 1;
  }
  for (const MixedDifference& of : mixed_differences) {
    if (is_there[of.first] && is_there[of.second] && is_there[of.both]) out |= bit, curvature += 2;
    bit <<= 1;
  }
  return out | curvature << curvature_bit;
}

Rule rule_of(Knowledge known) {
  switch (known) {
    case Knowledge::nothing:
      return 0;
    case Knowledge::value:
      return is_known;
    case Knowledge::not_negative:
      return is_not_negative;
    case Knowledge::not_positive:
      return is_not_positive;
  }
  return 0;  // no other kind
}

/// How each node is relaxed, by place.
std::vector<Rule> rules_of(const GridSize& size, const Layout& layout, std::span<const Knowledge> known,
                           std::span<const std::uint8_t> is_free) {
  std::vector<std::uint8_t> is_free_at(colors * layout.per_color, 0);  // by number
  for_each_node(size, layout, [&](std::size_t node, std::size_t number) { is_free_at[number] = is_free[node]; });
  std::vector<Rule> rules(is_free_at.size(), 0);
  for_each_node(size, layout, [&](std::size_t node, std::size_t number) {
    if (is_free_at[number] == 0) return;
    std::array<bool, stencil.size()> is_there{};
    for (std::size_t k = 0; k < stencil.size(); ++k) is_there[k] = is_free_at[layout.beside(number, k)] != 0;
    rules[layout.place(number)] = differences(is_there) | rule_of(known[node]);
  });
  return rules;
}

/// Blocks of one colour in which there is something to relax.
std::vector<std::uint32_t> blocks_of(std::size_t color, const Layout& layout, std::span<const Rule> rules) {
  std::vector<std::uint32_t> out;
  for (std::size_t at = color * layout.per_color; at < (color + 1) * layout.per_color; at += block)
    if (std::ranges::any_of(rules.subspan(at, block), [](Rule rule) { return rule != 0; }))
      out.push_back(std::uint32_t(at));
  return out;
}

/// From where the value of a node of one colour is to where those of its stencil are.
std::array<std::ptrdiff_t, stencil.size()> steps_of(std::size_t color, const Layout& layout) {
  const std::size_t number = layout.first + color;
  std::array<std::ptrdiff_t, stencil.size()> out{};
  for (std::size_t k = 0; k < stencil.size(); ++k)
    out[k] = std::ptrdiff_t(layout.place(layout.beside(number, k))) - std::ptrdiff_t(layout.place(number));
  return out;
}

}  // namespace

void relax(const GridSize& size, std::span<const Knowledge> known, std::span<const std::uint8_t> is_free, float pull,
           int sweeps, std::span<float> values) {
  [[maybe_unused]] const std::size_t nodes = node_index(size, 0, 0, size[2]);
  assert(nodes < std::size_t{1} << 31);  // blocks are numbered in 32 bits, padding included
  assert(known.size() == nodes && is_free.size() == nodes && values.size() == nodes);
  const Layout layout(size);
  const std::vector<Rule> rules = rules_of(size, layout, known, is_free);
  std::vector<float> relaxed(rules.size(), 0.0f);
  for_each_node(size, layout,
                [&](std::size_t node, std::size_t number) { relaxed[layout.place(number)] = values[node]; });
  const std::vector<float> measured = relaxed;
  std::array<Relaxed, colors> grids;
  std::array<std::vector<std::uint32_t>, colors> blocks;
  for (std::size_t color = 0; color < colors; ++color) {
    grids[color] = {steps_of(color, layout), rules.data(), measured.data(), relaxed.data(), pull};
    blocks[color] = blocks_of(color, layout, rules);
  }
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (std::size_t color = 0; color < colors; ++color)
      parallel_for(blocks[color].size(), blocks_per_task, [&](std::size_t begin, std::size_t end) {
        relax_blocks(grids[color], std::span(blocks[color]).subspan(begin, end - begin));
      });
  for_each_node(size, layout,
                [&](std::size_t node, std::size_t number) { values[node] = relaxed[layout.place(number)]; });
}

}  // namespace engine::repair
