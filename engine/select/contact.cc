#include "engine/select/contact.h"

#include <algorithm>
#include <utility>

#include "engine/core/median.h"
#include "engine/neighbours/neighbour_graph.h"
#include "engine/select/around.h"

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
  const Around around = look_around(scene, part, neighbours_joined);
  const neighbours::NeighbourGraph& graph = around.graph;
  const std::vector<std::uint8_t> is_selected = marked(around, selected);

  constexpr float none = -1;
  std::vector<std::uint32_t> nodes;  // [part] of the graph
  std::vector<float> across(part.size(), none),
      within;  // how alike the likest neighbour is: not selected, and selected
  for (std::uint32_t node = 0; node < around.size() && nodes.size() < part.size(); ++node) {
    if (around.rows[node] != part[nodes.size()]) continue;
    float inside = none;
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
      if (!around.touches(node, edge)) continue;
      float& best = is_selected[graph.to[edge]] != 0 ? inside : across[nodes.size()];
      best = std::max(best, around.alike[edge]);
    }
    if (inside > none) within.push_back(inside);
    nodes.push_back(node);
  }
  const float usual = within.empty() ? 0 : median(std::move(within));
  const bool grows_out = is_gone_on_into(graph, around.alike, goes_on_within * usual, nodes);
  std::vector<Touch> out;
  for (std::size_t k = 0; k < part.size(); ++k)
    out.push_back(across[k] == none                           ? Touch::nothing
                  : grows_out && across[k] >= goes_on * usual ? Touch::grows_out
                                                              : Touch::stands);
  return out;
}

}  // namespace engine::select
