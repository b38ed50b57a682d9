// How much two neighbouring Gaussians look like pieces of one surface.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/neighbours/neighbour_graph.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::select {

/// For each edge how much the two Gaussians overlap (Bhattacharyya coefficient: distance, normals and extents in one),
/// times exp(-e), where e sums the squared difference of their colours, up to a limit, and the angle between their
/// normals, where they are flat, and less if either hardly shows. Colours are those of SH band 0, evened out over
/// neighbours that overlap and look alike: single Gaussians of a trained scene differ from what they show together. The
/// same both ways.
///   rows     [n] of the cloud, one per node
///   returns  [edges], in [0, 1]
[[nodiscard]] std::vector<float> similarity_of_edges(const scene::GaussianCloud& cloud,
                                                     std::span<const std::uint32_t> rows,
                                                     const neighbours::NeighbourGraph& graph);

/// Of SH band 0, 0 to 1 per channel.
[[nodiscard]] Vec3 color_of(const scene::GaussianCloud& cloud, std::size_t row);

/// How much a Gaussian covers a point: its opacity times its falloff there, 0 to 1.
///   spacing  of its node, world units: none counts as thinner than half of that
[[nodiscard]] double cover(const scene::GaussianCloud& cloud, std::size_t row, double spacing, DVec3 point);

}  // namespace engine::select
