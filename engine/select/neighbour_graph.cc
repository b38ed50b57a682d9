#include "engine/select/neighbour_graph.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/parallel.h"

namespace engine::select {
namespace {

constexpr std::size_t grain = 4'096;  // nodes of a parallel task: a choice
constexpr double far_away = 1e18;     // world units; see points_of()

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

/// The edges that lists of nearest nodes make, in both directions.
///   nearest  [n][each] other nodes
NeighbourGraph undirected(std::span<const std::uint32_t> nearest, std::size_t n, std::size_t each) {
  NeighbourGraph graph;
  graph.begin.assign(n + 1, 0);
  for (std::size_t i = 0; i < nearest.size(); ++i) {
    ++graph.begin[i / each + 1];
    ++graph.begin[nearest[i] + 1];
  }
  for (std::size_t node = 0; node < n; ++node) graph.begin[node + 1] += graph.begin[node];
  graph.to.resize(graph.begin[n]);
  std::vector<std::uint32_t> next(graph.begin.begin(), graph.begin.end() - 1);
  for (std::size_t i = 0; i < nearest.size(); ++i) {
    graph.to[next[i / each]++] = nearest[i];
    graph.to[next[nearest[i]]++] = std::uint32_t(i / each);
  }
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

}  // namespace

std::vector<float> points_of(const Array3& mean, std::span<const std::uint32_t> rows, DVec3 origin) {
  std::vector<float> points(3 * rows.size());
  parallel_for(rows.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const DVec3 offset = DVec3(mean.get(rows[i])) - origin;
      for (int axis = 0; axis < 3; ++axis)
        points[3 * i + std::size_t(axis)] = float(std::clamp(offset[axis], -far_away, far_away));
    }
  });
  return points;
}

NeighbourGraph join_nearest(std::span<const float> points, const neighbours::PointIndex& index, std::size_t k) {
  const std::size_t n = index.size();
  const std::size_t each = std::min(k, n > 0 ? n - 1 : 0);
  if (each == 0) {
    NeighbourGraph alone;
    alone.begin.assign(n + 1, 0);
    alone.spacing.assign(n, 0.0f);
    return alone;
  }
  std::vector<std::uint32_t> nearest(n * each);
  std::vector<float> spacing(n);
  const auto found = index.nearest(points, each + 1);
  parallel_for(n, grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t node = begin; node < end; ++node) {
      std::size_t taken = 0;
      double sum = 0;
      // Among points at the very same place, a node need not be the first of those found, nor be found at all.
      for (std::size_t j = 0; j <= each && taken < each; ++j) {
        const neighbours::Neighbour& other = found[node * (each + 1) + j];
        if (other.index == node) continue;
        nearest[node * each + taken++] = other.index;
        sum += std::sqrt(double(other.squared_distance));
      }
      spacing[node] = float(sum / double(each));
    }
  });
  NeighbourGraph graph = undirected(nearest, n, each);
  graph.spacing = std::move(spacing);
  measure_edges(points, graph);
  return graph;
}

}  // namespace engine::select
