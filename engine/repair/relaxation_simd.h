// What relax() does at one node, in vectors, and what of a node it needs to know.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace engine::repair {

using Offset = std::array<int, 3>;

/// The nodes that the bending at a node and its neighbours depends on: those up to two steps away.
constexpr std::array<Offset, 25> stencil = [] {
  std::array<Offset, 25> out{};
  std::size_t count = 0;
  for (int z = -2; z <= 2; ++z)
    for (int y = -2; y <= 2; ++y)
      for (int x = -2; x <= 2; ++x)
        if ((x < 0 ? -x : x) + (y < 0 ? -y : y) + (z < 0 ? -z : z) <= 2) out[count++] = {x, y, z};
  return out;
}();

/// Where a node is in the stencil; its length if it is not.
constexpr std::size_t in_stencil(const Offset& by) {
  std::size_t k = 0;
  while (k < stencil.size() && stencil[k] != by) ++k;
  return k;
}

/// Nodes beside, diagonally beside and beyond the node in the plane of one axis and the next. In the stencil.
struct Plane {
  std::array<std::size_t, 2> beside{}, beyond{};
  std::array<std::size_t, 4> diagonal{};
};
constexpr std::array<Plane, 3> planes = [] {
  std::array<Plane, 3> out{};
  for (std::size_t a = 0; a < 3; ++a) {
    const auto at = [a](int u, int v) {
      Offset by{};
      by[a] = u, by[(a + 1) % 3] = v;
      return in_stencil(by);
    };
    out[a] = {{at(1, 0), at(-1, 0)}, {at(2, 0), at(-2, 0)}, {at(1, 1), at(1, -1), at(-1, 1), at(-1, -1)}};
  }
  return out;
}();

/// (f(before) - 2 f(at) + f(after))^2, one of what is to be small; `at` is the node or next to it. In the stencil.
struct StraightDifference {
  std::size_t before = 0, at = 0, after = 0;
  float share = 0;  ///< Of the node in the difference.
};
constexpr std::array<StraightDifference, 9> straight_differences = [] {
  std::array<StraightDifference, 9> out{};
  std::size_t count = 0;
  for (std::size_t a = 0; a < 3; ++a)
    for (int middle = -1; middle <= 1; ++middle) {
      Offset before{}, at{}, after{};
      before[a] = middle - 1, at[a] = middle, after[a] = middle + 1;
      out[count++] = {in_stencil(before), in_stencil(at), in_stencil(after), middle == 0 ? -2.0f : 1.0f};
    }
  return out;
}();

/// 2 (f(here) - f(first) - f(second) + f(both))^2: the mixed derivatives of a plate are two. In the stencil.
struct MixedDifference {
  std::size_t first = 0, second = 0, both = 0;
};
constexpr std::array<MixedDifference, 12> mixed_differences = [] {
  std::array<MixedDifference, 12> out{};
  std::size_t count = 0;
  for (std::size_t a = 0; a < 3; ++a)
    for (const int u : {-1, 1})
      for (const int v : {-1, 1}) {
        Offset first{}, second{}, both{};
        first[a] = both[a] = u, second[(a + 1) % 3] = both[(a + 1) % 3] = v;
        out[count++] = {in_stencil(first), in_stencil(second), in_stencil(both)};
      }
  return out;
}();

/// How a node is relaxed, in bits: one for each of the differences above that counts, straight ones first, half the
/// second derivative of their sum, and what is known of the node. 0: not at all.
using Rule = std::uint32_t;
constexpr int curvature_bit = straight_differences.size() + mixed_differences.size();
constexpr Rule every_difference = (Rule{1} << curvature_bit) - 1;
constexpr Rule curvature_mask = 63;  // 42 where every difference counts
constexpr int knowledge_bit = curvature_bit + 6;
constexpr Rule is_known = Rule{1} << knowledge_bit, is_not_negative = is_known << 1, is_not_positive = is_known << 2;

constexpr std::size_t block = 16;  ///< Nodes that are relaxed at once: no vector is longer.

/// A grid whose nodes of one colour are in a row. Lanes of a block that are not to be relaxed stay as they are.
struct Relaxed {
  std::array<std::ptrdiff_t, stencil.size()> step{};  ///< From a node of the colour to those of its stencil.
  const Rule* rules = nullptr;
  const float* measured = nullptr;  ///< What is known, where something is.
  float* values = nullptr;
  float pull = 0;
};

/// Relaxes the nodes of these blocks, each given by its first node.
void relax_blocks(const Relaxed& grid, std::span<const std::uint32_t> blocks);

}  // namespace engine::repair
