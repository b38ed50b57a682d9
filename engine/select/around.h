// The rows around some rows of a scene, joined to those next to them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/neighbours/neighbour_graph.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/overlay.h"

namespace engine::select {

struct Around {
  std::vector<std::uint32_t> rows;   ///< [n] of the scene, ascending: in the box around some rows, and near to it.
  scene::GaussianCloud cloud;        ///< [n] those rows.
  neighbours::NeighbourGraph graph;  ///< Node i is rows[i].
  std::vector<float> alike;          ///< [edges] of similarity_of_edges().

  [[nodiscard]] std::size_t size() const { return rows.size(); }
  /// Are the ends of an edge of this node next to each other, and not only the nearest that there are?
  [[nodiscard]] bool touches(std::uint32_t node, std::uint32_t edge) const {
    return graph.length[edge] <= neighbours::joining_spacings * graph.spacing[node];
  }
};

/// Which of the rows around: all, or those that show from outside (exposed.h).
enum class Which : std::uint8_t { all, exposed };

/// About a second for 250,000 rows in the box, with eight neighbours each.
///   rows  of the scene, ascending, at least one (asserted)
///   k     neighbours that each is joined to
[[nodiscard]] Around look_around(const scene::LayeredCloud& scene, std::span<const std::uint32_t> rows, std::size_t k,
                                 Which which = Which::all);

/// [n] 1 for each of the rows around that is among the given ones (ascending).
[[nodiscard]] std::vector<std::uint8_t> marked(const Around& around, std::span<const std::uint32_t> rows);

}  // namespace engine::select
