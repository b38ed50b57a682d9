#include "engine/select/contact.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

#include "engine/core/median.h"
#include "engine/neighbours/neighbour_graph.h"
#include "engine/neighbours/point_index.h"
#include "engine/select/similarity.h"

namespace engine::select {
namespace {

constexpr std::size_t neighbours_joined = 8;  // the next ring of a surface
// A surface goes on where neighbours across the border are this much as alike as those within usually are: those of a
// cup and its table have 0.02 to 0.05, those of a cheek cut in two 0.3 to 1.
constexpr float goes_on = 0.3f;
// Within a part, where fur and patterns are steps of a surface, too: so much as alike as neighbours usually are.
// Surfaces of the rest then go on over 0 to 12 % of a mug, a board and a plant, however widely selected, over 77 and 84
// % of the ear and the head of a fox, over 99 % of a jaw, and over 45 % of an arm that holds a helmet.
constexpr float goes_on_within = 0.09f;
constexpr double over = 0.3;
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

/// Do surfaces of the rest go on into the part, over a good deal of it? They go on to a node where two of its
/// neighbours there look like it, as a single one may by chance.
///   least  how alike neighbours on one surface are at least
///   part   nodes of the graph, ascending; the others are the rest
bool is_gone_on_into(const neighbours::NeighbourGraph& graph, std::span<const float> alike, float least,
                     std::span<const std::uint32_t> part) {
  constexpr std::uint8_t needed = 2;
  std::vector<std::uint8_t> votes(graph.size(), needed);  // the rest has enough
  for (const std::uint32_t node : part) votes[node] = 0;
  std::vector<std::uint32_t> queue;
  for (std::uint32_t node = 0; node < graph.size(); ++node)
    if (votes[node] == needed) queue.push_back(node);
  const std::size_t rest = queue.size();
  for (std::size_t k = 0; k < queue.size(); ++k)
    for (std::uint32_t edge = graph.begin[queue[k]]; edge < graph.begin[queue[k] + 1]; ++edge)
      if (const std::uint32_t other = graph.to[edge]; votes[other] < needed && alike[edge] >= least)
        if (++votes[other] == needed) queue.push_back(other);
  return double(queue.size() - rest) >= over * double(part.size());
}

}  // namespace

std::vector<Touch> contact_of(const scene::LayeredCloud& scene, std::span<const std::uint32_t> part,
                              std::span<const std::uint32_t> selected) {
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
  const float usual = within.empty() ? 0 : median(std::move(within));
  const bool grows_out = is_gone_on_into(graph, alike, goes_on_within * usual, nodes);
  std::vector<Touch> out;
  for (std::size_t k = 0; k < part.size(); ++k)
    out.push_back(across[k] == none                           ? Touch::nothing
                  : grows_out && across[k] >= goes_on * usual ? Touch::grows_out
                                                              : Touch::stands);
  return out;
}

}  // namespace engine::select
