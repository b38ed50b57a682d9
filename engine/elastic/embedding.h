// A body of points and the few nodes that it follows: an embedded deformation graph.
// Source: Sumner, Schmid and Pauly 2007, "Embedded deformation for shape manipulation", section 3. Distances here are
// those along the body, so that neither nodes nor points have a say across a gap, such as between jaws or fingers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/neighbours/neighbour_graph.h"

namespace engine::elastic {

/// Nodes and what joins them, both directions of each edge side by side with the rest of its node.
struct Graph {
  std::vector<DVec3> rest;           ///< [M] where a node is before anything moves.
  std::vector<std::uint32_t> begin;  ///< [M + 1] into `to`: the edges of node i are [begin[i], begin[i + 1]).
  std::vector<std::uint32_t> to;     ///< [E] node at the other end, ascending for each node.
  std::vector<double> weight;        ///< [E] above 0, the same both ways: how much of the body goes along an edge.

  [[nodiscard]] std::size_t size() const { return rest.size(); }
};

/// Points and the nodes that each follows.
struct Embedding {
  Graph graph;                          ///< Connected.
  std::vector<std::uint32_t> point_of;  ///< [M] the point that a node sits on.
  std::vector<std::uint32_t> cell;      ///< [N] the node that a point is nearest to, along the body.
  std::vector<std::uint32_t> begin;     ///< [N + 1] into `node`: those that a point follows.
  std::vector<std::uint32_t> node;      ///< Each once per point.
  std::vector<float> weight;            ///< Above 0; those of a point sum to 1.
  double spacing = 0;                   ///< How far nodes are from the ones they are joined to, about.
};

/// How finely a body is taken.
struct EmbeddingOptions {
  std::size_t nodes = 500;  ///< At most; 1 or more. Time of a solve grows a little faster than in proportion.
};

/// Chooses nodes among the points, each as far as possible from those before it along the body; joins those whose cells
/// touch, the more weight the broader the contact; and lets each point follow those of its own node and the two rings
/// around it that are near, with weights that fade to zero with the distance. What does not hang together with anything
/// near is joined to the nearest part of the rest by one edge: it goes along. The same for any number of threads.
///   points   [n][3], finite, n at least 1
///   joined   these points, joined to the nearest ones and not bridged: an edge counts if it is not much longer than
///            both its ends' spacing
///   seeds    points that are to be nodes, the first ones; may name a point twice. At most options.nodes count.
/// About 0.1 s for 30,000 points that hang together.
[[nodiscard]] Embedding embed(std::span<const float> points, const neighbours::NeighbourGraph& joined,
                              std::span<const std::uint32_t> seeds, const EmbeddingOptions& options = {});

/// A point, and how far it is.
struct Near {
  std::uint32_t point = 0;
  double distance = 0;
};

/// The points within `distance` of a point along the body, itself first; of equally far ones the lower index first.
[[nodiscard]] std::vector<Near> points_within(const neighbours::NeighbourGraph& joined, std::uint32_t point,
                                              double distance);

/// How far each point is from the nearest of some, along the body; infinity where there is no way to one.
[[nodiscard]] std::vector<double> distances_to(const neighbours::NeighbourGraph& joined,
                                               std::span<const std::uint32_t> points);
/// The same for nodes, from node to node.
[[nodiscard]] std::vector<double> distances_to(const Graph& graph, std::span<const std::uint32_t> nodes);

}  // namespace engine::elastic
