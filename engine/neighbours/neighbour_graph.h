// Rows joined to the rows nearest to them: what growing and connected pieces go by.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "engine/core/soa.h"
#include "engine/core/vec.h"
#include "engine/neighbours/point_index.h"

namespace engine::neighbours {

/// An undirected graph of n nodes: of each edge, both directions, side by side with the rest of its node.
struct NeighbourGraph {
  std::vector<std::uint32_t> begin;  ///< [n + 1] into `to`: the edges of node i are [begin[i], begin[i + 1]).
  std::vector<std::uint32_t> to;     ///< [E] node at the other end, ascending for each node.
  std::vector<std::uint32_t> back;   ///< [E] the same edge the other way.
  std::vector<float> length;         ///< [E] world units.
  std::vector<float> spacing;        ///< [n] mean distance of a node to its nearest ones, world units.

  [[nodiscard]] std::size_t size() const { return spacing.size(); }
};

/// A point, and means of rows, as PointIndex takes them: relative to `origin`, so that none of their digits is lost,
/// and no farther than 1e18 from it, so that squares of distances fit a float.
[[nodiscard]] std::array<float, 3> point_of(DVec3 point, DVec3 origin);
[[nodiscard]] std::vector<float> points_of(const Array3& mean, std::span<const std::uint32_t> rows, DVec3 origin);

/// Those of `rows` whose means are nearest to that of each row of `of`: [of][min(k, rows)], nearest first.
[[nodiscard]] std::vector<std::uint32_t> nearest_rows(const Array3& mean, std::span<const std::uint32_t> rows,
                                                      std::span<const std::uint32_t> of, std::size_t k);

/// So many spacings apart, of either, nodes still hang together: a gap of two missing rows.
constexpr float joining_spacings = 3.0f;

/// Joins each point to the k nearest other ones (fewer where there are not as many): an edge where one of the two is
/// among the nearest of the other. Then, if asked to, joins what is not connected so, but hangs together. Node i is
/// point i. The same for any number of threads.
///   points  [n][3], n below 2^31 / (2 k)
///   index   of these points
[[nodiscard]] NeighbourGraph join_nearest(std::span<const float> points, const PointIndex& index, std::size_t k,
                                          bool bridged = true);

/// Which piece each of n nodes belongs to, while they are joined one by one. A piece goes by its lowest node.
class Pieces {
 public:
  explicit Pieces(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0u); }

  [[nodiscard]] std::uint32_t of(std::uint32_t node) {
    while (parent_[node] != node) node = parent_[node] = parent_[parent_[node]];
    return node;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = of(a), b = of(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }
  [[nodiscard]] std::vector<std::uint32_t> sizes();  ///< [n] nodes of each piece, at its lowest node; else 0.

 private:
  std::vector<std::uint32_t> parent_;
};

}  // namespace engine::neighbours
