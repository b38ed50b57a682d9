// Points of simple bodies, as embed() takes them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/rng.h"
#include "engine/core/vec.h"
#include "engine/neighbours/neighbour_graph.h"
#include "engine/neighbours/point_index.h"

namespace engine::elastic {

/// A rectangle of points at z, each off its place by a little.
inline void add_sheet(std::vector<float>& points, int columns, int rows, float step, float z, std::uint64_t seed = 1) {
  Rng rng(seed, 0);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      points.push_back(step * (float(x) + 0.1f * rng.normal()));
      points.push_back(step * (float(y) + 0.1f * rng.normal()));
      points.push_back(z);
    }
}

inline neighbours::NeighbourGraph joined(const std::vector<float>& points) {
  return neighbours::join_nearest(points, neighbours::PointIndex(points, 3), 8, /*bridged=*/false);
}

inline DVec3 point_at(const std::vector<float>& points, std::size_t i) {
  return {points[3 * i], points[3 * i + 1], points[3 * i + 2]};
}

}  // namespace engine::elastic
