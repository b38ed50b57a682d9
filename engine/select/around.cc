#include "engine/select/around.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <utility>

#include "engine/core/median.h"
#include "engine/core/rows.h"
#include "engine/neighbours/point_index.h"
#include "engine/select/exposed.h"
#include "engine/select/similarity.h"

namespace engine::select {
namespace {

// Of the box's longest side: what lies within has its own neighbours around it.
constexpr float beyond = 0.15f;

/// Rows in the box around these, and a little beyond it, at least `reach`; ascending.
std::vector<std::uint32_t> rows_around(const Array3& means, std::span<const std::uint32_t> rows, float reach) {
  Vec3 low = means.get(rows[0]), high = low;
  for (const std::uint32_t row : rows) low = glm::min(low, means.get(row)), high = glm::max(high, means.get(row));
  const Vec3 size = high - low, margin(std::max(beyond * std::max({size.x, size.y, size.z}), reach));
  std::vector<std::uint32_t> out;
  low -= margin, high += margin;
  for (std::uint32_t row = 0; row < means.size(); ++row) {
    const Vec3 mean = means.get(row);
    if (glm::clamp(mean, low, high) == mean) out.push_back(row);
  }
  return out;
}

/// How far the neighbours of a few rows may be: by their own extents, as a small box says nothing of it. World units.
float reach_of(const scene::GaussianCloud& part) {
  constexpr float extents = 8, most_log = 40;  // far beyond any neighbour; a square of it fits a float
  std::vector<float> longest;
  for (std::size_t row = 0; row < part.size(); ++row) {
    const Vec3 log_scale = part.log_scale.get(row);
    longest.push_back(std::max({log_scale.x, log_scale.y, log_scale.z}));
  }
  return extents * std::exp(std::min(median(std::move(longest)), most_log));
}

}  // namespace

Around look_around(const scene::LayeredCloud& scene, std::span<const std::uint32_t> rows, std::size_t k, Which which) {
  assert(!rows.empty());
  Around around;
  around.rows = rows_around(scene::means(scene), rows, reach_of(scene::gather(scene, rows)));
  around.cloud = scene::gather(scene, around.rows);
  if (which == Which::exposed) {
    std::vector<std::uint32_t> shown;
    for (const std::uint32_t i : marked_rows(exposed_rows(around.cloud))) shown.push_back(around.rows[i]);
    around.rows = std::move(shown);
    around.cloud = scene::gather(scene, around.rows);
  }
  std::vector<std::uint32_t> all(around.size());
  std::iota(all.begin(), all.end(), 0u);
  const std::vector<float> points =
      neighbours::points_of(around.cloud.mean, all, all.empty() ? DVec3(0.0) : DVec3(around.cloud.mean.get(0)));
  around.graph = neighbours::join_nearest(points, neighbours::PointIndex(points, 3), k);
  around.alike = similarity_of_edges(around.cloud, all, around.graph);
  return around;
}

std::vector<std::uint8_t> marked(const Around& around, std::span<const std::uint32_t> rows) {
  std::vector<std::uint8_t> out(around.size());
  std::size_t next = 0;
  for (std::uint32_t node = 0; node < around.size() && next < rows.size(); ++node) {
    while (next < rows.size() && rows[next] < around.rows[node]) ++next;
    if (next < rows.size() && rows[next] == around.rows[node]) out[node] = 1;
  }
  return out;
}

}  // namespace engine::select
