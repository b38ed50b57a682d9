// A function on a grid, continued where nothing is known of it.
//
// What is known of a surface tells where it goes: planes go on as planes, and where two of them meet they meet. A
// function that only goes on smoothly (Laplace's equation) spans a tent between them, and bulges on a floor.
// Source: Turk and O'Brien 1999, "Shape transformation using variational implicit functions", for what is minimised;
// Brandt and Cryer 1983, "Multigrid algorithms for the solution of linear complementarity problems", for bounds.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace engine::repair {

using GridSize = std::array<int, 3>;  ///< Nodes along x, y, z; x changes fastest.

constexpr std::size_t node_index(const GridSize& size, int x, int y, int z) {
  return (std::size_t(z) * std::size_t(size[1]) + std::size_t(y)) * std::size_t(size[0]) + std::size_t(x);
}

/// What is known of the function at a node.
enum class Knowledge : std::uint8_t { nothing, value, not_negative, not_positive };

/// Gives nodes of which nothing is known, and up to eight nodes around each of them, the values that bend the function
/// least: the sum of its squared second differences, mixed ones twice, is least, together with that of squared
/// differences from what is known, and the bounds hold; as nearly as some sweeps come to it, from coarse to fine.
///   known   [nodes]
///   values  [nodes] In: what is known; where only a bound is, a value within it; where nothing is, a finite first
///   guess. Out: the
///           function; other nodes stay as they are. The same bits for any number of threads
void continue_with_least_bending(const GridSize& size, std::span<const Knowledge> known, std::vector<float>& values);

}  // namespace engine::repair
