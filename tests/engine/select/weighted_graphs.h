// Graphs to walk on, edge by edge.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/neighbours/neighbour_graph.h"

namespace engine::select {

struct WeightedEdge {
  std::uint32_t a = 0, b = 0;
  float weight = 1;
};

struct WeightedGraph {
  neighbours::NeighbourGraph graph;  ///< Without lengths.
  std::vector<float> weight;
};

inline WeightedGraph graph_of(std::size_t nodes, const std::vector<WeightedEdge>& edges) {
  struct Half {
    std::uint32_t from, to;
    float weight;
  };
  std::vector<Half> halves;
  for (const auto& [a, b, weight] : edges) halves.push_back({a, b, weight}), halves.push_back({b, a, weight});
  std::sort(halves.begin(), halves.end(),
            [](const Half& a, const Half& b) { return a.from != b.from ? a.from < b.from : a.to < b.to; });
  WeightedGraph out;
  out.graph.begin.assign(nodes + 1, 0);
  out.graph.spacing.assign(nodes, 1.0f);
  for (const Half& half : halves) {
    ++out.graph.begin[half.from + 1];
    out.graph.to.push_back(half.to);
    out.weight.push_back(half.weight);
  }
  for (std::size_t node = 0; node < nodes; ++node) out.graph.begin[node + 1] += out.graph.begin[node];
  return out;
}

/// A chain of so many nodes.
inline std::vector<WeightedEdge> chain(std::uint32_t from, std::uint32_t to, float weight = 1) {
  std::vector<WeightedEdge> out;
  for (std::uint32_t node = from; node + 1 < to; ++node) out.push_back({node, node + 1, weight});
  return out;
}

/// Where a strip is joined otherwise: the edges along it from this row to the next one.
struct Joint {
  std::uint32_t after_row = 0;
  float weight = 1;
};
/// A strip of a surface, 20 wide and 60 long: rows of 20 nodes, joined by edges of weight 1 but at two joints.
inline WeightedGraph strip(Joint first, Joint second) {
  constexpr std::uint32_t wide = 20, rows = 60;
  std::vector<WeightedEdge> edges;
  for (std::uint32_t row = 0; row < rows; ++row)
    for (std::uint32_t i = 0; i < wide; ++i) {
      const std::uint32_t node = row * wide + i;
      if (i + 1 < wide) edges.push_back({node, node + 1});
      const float along = row == first.after_row ? first.weight : row == second.after_row ? second.weight : 1.0f;
      if (row + 1 < rows) edges.push_back({node, node + wide, along});
    }
  return graph_of(wide * rows, edges);
}

/// A square grid of side^2 nodes.
inline std::vector<WeightedEdge> grid(std::uint32_t side) {
  std::vector<WeightedEdge> out;
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      if (x + 1 < side) out.push_back({y * side + x, y * side + x + 1});
      if (y + 1 < side) out.push_back({y * side + x, (y + 1) * side + x});
    }
  return out;
}

}  // namespace engine::select
