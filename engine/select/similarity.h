// How much two neighbouring Gaussians look like pieces of one surface.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/scene/gaussian_cloud.h"
#include "engine/select/neighbour_graph.h"

namespace engine::select {

/// exp(-e) for each edge, where e sums squares of: distance by spacing, difference of colours (of SH band 0), angle
/// between normals (of flat Gaussians), difference of log sizes; each by what is usual in this graph. The same both
/// ways.
///   rows     [n] of the cloud, one per node
///   returns  [edges], in [0, 1]
[[nodiscard]] std::vector<float> similarity_of_edges(const scene::GaussianCloud& cloud,
                                                     std::span<const std::uint32_t> rows, const NeighbourGraph& graph);

}  // namespace engine::select
