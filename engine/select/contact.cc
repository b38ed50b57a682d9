#include "engine/select/contact.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <utility>

#include "engine/neighbours/neighbour_graph.h"
#include "engine/neighbours/point_index.h"
#include "engine/select/similarity.h"

namespace engine::select {
namespace {

constexpr std::size_t neighbours_joined = 8;  // the next ring of a surface
// A surface goes on where neighbours across the border are this much as alike as those within usually are: those of a
// cup and its table have 0.02 to 0.05, those of a cheek cut in two 0.3 to 1.
constexpr float goes_on = 0.3f;
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

float median(std::vector<float> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
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

/// Where the surface goes on to from the handles, over nodes of the part alone: a node belongs to it if two of its
/// neighbours there look like it, as a single one may by chance. All of the part, where that is so little of it that
/// a pattern must have stopped it.
///   least    how alike neighbours on one surface are at least
///   returns  [nodes of the graph] 1: it goes on to there
std::vector<std::uint8_t> reached_from(std::span<const DVec3> handles, const Array3& mean,
                                       const neighbours::NeighbourGraph& graph, std::span<const float> alike,
                                       float least, std::span<const std::uint32_t> part) {
  constexpr std::uint8_t needed = 2;
  constexpr double least_share = 0.25;
  std::vector<std::uint8_t> votes(graph.size(), needed), reached(graph.size(), 0);
  for (const std::uint32_t node : part) votes[node] = 0;  // the others never get enough: they are not asked
  std::vector<std::uint32_t> queue;
  const auto reach = [&](std::uint32_t node) {
    if (!std::exchange(reached[node], std::uint8_t{1})) queue.push_back(node);
  };
  for (const DVec3& handle : handles) {
    const std::uint32_t nearest = *std::ranges::min_element(
        part, {}, [&](std::uint32_t node) { return glm::distance(DVec3(mean.get(node)), handle); });
    reach(nearest);
    for (std::uint32_t edge = graph.begin[nearest]; edge < graph.begin[nearest + 1]; ++edge)
      if (votes[graph.to[edge]] < needed && alike[edge] >= least) reach(graph.to[edge]);
  }
  std::size_t count = 0;
  for (; count < queue.size(); ++count)
    for (std::uint32_t edge = graph.begin[queue[count]]; edge < graph.begin[queue[count] + 1]; ++edge)
      if (const std::uint32_t other = graph.to[edge]; votes[other] < needed && alike[edge] >= least)
        if (++votes[other] == needed) reach(other);
  if (double(count) < least_share * double(part.size())) reached.assign(graph.size(), 1);
  return reached;
}

}  // namespace

std::vector<Touch> contact_of(const scene::LayeredCloud& scene, std::span<const std::uint32_t> part,
                              std::span<const std::uint32_t> selected, std::span<const DVec3> handles) {
  assert(!part.empty());
  const std::vector<std::uint32_t> around =
      rows_around(scene::means(scene), part, reach_of(scene::gather(scene, part)));
  const scene::GaussianCloud cloud = scene::gather(scene, around);
  std::vector<std::uint32_t> all(around.size());
  std::iota(all.begin(), all.end(), 0u);
  const std::vector<float> points = neighbours::points_of(cloud.mean, all, DVec3(cloud.mean.get(0)));
  const neighbours::NeighbourGraph graph =
      neighbours::join_nearest(points, neighbours::PointIndex(points, 3), neighbours_joined);
  const std::vector<float> alike = similarity_of_edges(cloud, all, graph);

  constexpr float none = -1;
  std::vector<std::uint32_t> nodes;  // [part] of the graph
  std::vector<float> across(part.size(), none),
      within;  // how alike the likest neighbour is: not selected, and selected
  for (std::uint32_t node = 0; node < around.size() && nodes.size() < part.size(); ++node) {
    if (around[node] != part[nodes.size()]) continue;
    float inside = none;
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
      if (graph.length[edge] > neighbours::joining_spacings * graph.spacing[node]) continue;
      float& best = std::ranges::binary_search(selected, around[graph.to[edge]]) ? inside : across[nodes.size()];
      best = std::max(best, alike[edge]);
    }
    if (inside > none) within.push_back(inside);
    nodes.push_back(node);
  }
  const float least = goes_on * median(std::move(within));
  const std::vector<std::uint8_t> reached = reached_from(handles, cloud.mean, graph, alike, least, nodes);
  std::vector<Touch> out;
  for (std::size_t k = 0; k < part.size(); ++k)
    out.push_back(across[k] == none                         ? Touch::nothing
                  : across[k] >= least && reached[nodes[k]] ? Touch::grows_out
                                                            : Touch::stands);
  return out;
}

}  // namespace engine::select
