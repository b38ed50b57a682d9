#include "engine/neighbours/neighbour_graph.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/parallel.h"

namespace engine::neighbours {
namespace {

constexpr std::size_t grain = 4'096;  // nodes of a parallel task: a choice
// Nearest nodes among which a piece looks for another one: the next ring but one of a surface.
constexpr std::size_t looked_across = 24;
constexpr double far_away = 1e18;  // world units; see points_of()

/// Drops what is listed twice of each node's edges, which ascend, and what joins a node to itself.
void drop_doubles(NeighbourGraph& graph) {
  std::uint32_t kept = 0, first = 0;
  for (std::size_t node = 0; node + 1 < graph.begin.size(); ++node) {
    const std::uint32_t from = first, end = graph.begin[node + 1];
    first = end;
    const std::uint32_t own = kept;
    for (std::uint32_t edge = from; edge < end; ++edge)
      if (kept == own || graph.to[kept - 1] != graph.to[edge]) graph.to[kept++] = graph.to[edge];
    graph.begin[node + 1] = kept;
  }
  graph.to.resize(kept);
}

struct Pair {
  std::uint32_t a, b;
};

/// The edges that pairs of nodes make, in both directions; pairs may come more than once.
NeighbourGraph undirected(std::span<const Pair> pairs, std::size_t n) {
  NeighbourGraph graph;
  graph.begin.assign(n + 1, 0);
  for (const auto [a, b] : pairs) ++graph.begin[a + 1], ++graph.begin[b + 1];
  for (std::size_t node = 0; node < n; ++node) graph.begin[node + 1] += graph.begin[node];
  graph.to.resize(graph.begin[n]);
  std::vector<std::uint32_t> next(graph.begin.begin(), graph.begin.end() - 1);
  for (const auto [a, b] : pairs) graph.to[next[a]++] = b, graph.to[next[b]++] = a;
  parallel_for(n, grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t node = begin; node < end; ++node)
      std::sort(graph.to.begin() + graph.begin[node], graph.to.begin() + graph.begin[node + 1]);
  });
  drop_doubles(graph);
  return graph;
}

/// Fills in lengths, and where each edge's other direction stands.
void measure_edges(std::span<const float> points, NeighbourGraph& graph) {
  graph.back.resize(graph.to.size());
  graph.length.resize(graph.to.size());
  parallel_for(graph.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t node = begin; node < end; ++node)
      for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
        const std::uint32_t other = graph.to[edge];
        const auto first = graph.to.begin() + graph.begin[other], last = graph.to.begin() + graph.begin[other + 1];
        graph.back[edge] = std::uint32_t(std::lower_bound(first, last, std::uint32_t(node)) - graph.to.begin());
        double squared = 0;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const double step = double(points[3 * node + axis]) - double(points[3 * other + axis]);
          squared += step * step;
        }
        graph.length[edge] = float(std::sqrt(squared));
      }
  });
}

/// Pairs of nodes of different pieces that hang together nevertheless: where a piece is dense, or thin as the handle of
/// a mug, the nearest nodes of each are all its own. Found from all pieces but the largest.
std::vector<Pair> bridges(std::span<const float> points, const PointIndex& index, std::span<const float> spacing,
                          Pieces& pieces) {
  const std::vector<std::uint32_t> sizes = pieces.sizes();
  const auto largest = std::uint32_t(std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  std::vector<std::uint32_t> nodes;
  std::vector<float> queries;
  for (std::uint32_t node = 0; node < spacing.size(); ++node) {
    if (pieces.of(node) == largest) continue;
    nodes.push_back(node);
    queries.insert(queries.end(), points.begin() + 3 * node, points.begin() + 3 * node + 3);
  }
  const auto found = index.nearest(queries, looked_across);
  const std::size_t each = std::min(looked_across, index.size());
  std::vector<Pair> out;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (std::size_t j = 0; j < each; ++j) {
      const Neighbour& other = found[i * each + j];
      const float limit = joining_spacings * std::min(spacing[nodes[i]], spacing[other.index]);
      if (pieces.of(other.index) != pieces.of(nodes[i]) && other.squared_distance <= limit * limit)
        out.push_back({nodes[i], other.index});
    }
  return out;
}

}  // namespace

std::array<float, 3> point_of(DVec3 point, DVec3 origin) {
  const DVec3 offset = glm::clamp(point - origin, DVec3(-far_away), DVec3(far_away));
  return {float(offset.x), float(offset.y), float(offset.z)};
}

std::vector<float> points_of(const Array3& mean, std::span<const std::uint32_t> rows, DVec3 origin) {
  std::vector<float> points(3 * rows.size());
  parallel_for(rows.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::array<float, 3> point = point_of(DVec3(mean.get(rows[i])), origin);
      std::copy(point.begin(), point.end(), points.begin() + std::ptrdiff_t(3 * i));
    }
  });
  return points;
}

std::vector<std::uint32_t> nearest_rows(const Array3& mean, std::span<const std::uint32_t> rows,
                                        std::span<const std::uint32_t> of, std::size_t k) {
  if (rows.empty() || of.empty()) return {};
  const DVec3 origin = mean.get(of[0]);
  std::vector<std::uint32_t> nearest;
  for (const Neighbour& found : PointIndex(points_of(mean, rows, origin), 3).nearest(points_of(mean, of, origin), k))
    nearest.push_back(rows[found.index]);
  return nearest;
}

NeighbourGraph join_nearest(std::span<const float> points, const PointIndex& index, std::size_t k, bool bridged) {
  const std::size_t n = index.size();
  const std::size_t each = std::min(k, n > 0 ? n - 1 : 0);
  std::vector<Pair> pairs(n * each);
  std::vector<float> spacing(n, 0.0f);
  const auto found = index.nearest(points, each + 1);
  if (each > 0)
    parallel_for(n, grain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t node = begin; node < end; ++node) {
        std::size_t taken = 0;
        double sum = 0;
        // Among points at the very same place, a node need not be the first of those found, nor be found at all.
        for (std::size_t j = 0; j <= each && taken < each; ++j) {
          const Neighbour& other = found[node * (each + 1) + j];
          if (other.index == node) continue;
          pairs[node * each + taken++] = {std::uint32_t(node), other.index};
          sum += std::sqrt(double(other.squared_distance));
        }
        spacing[node] = float(sum / double(each));
      }
    });
  Pieces pieces(n);
  for (const auto [a, b] : pairs) pieces.join(a, b);
  if (bridged)
    for (const Pair bridge : bridges(points, index, spacing, pieces)) pairs.push_back(bridge);
  NeighbourGraph graph = undirected(pairs, n);
  graph.spacing = std::move(spacing);
  measure_edges(points, graph);
  return graph;
}

std::vector<std::uint32_t> Pieces::sizes() {
  std::vector<std::uint32_t> sizes(parent_.size(), 0);
  for (std::uint32_t node = 0; node < parent_.size(); ++node) ++sizes[of(node)];
  return sizes;
}

}  // namespace engine::neighbours
