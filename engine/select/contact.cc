#include "engine/select/contact.h"

#include <algorithm>
#include <utility>

#include "engine/core/median.h"
#include "engine/neighbours/neighbour_graph.h"
#include "engine/select/around.h"
#include "engine/select/firmness.h"

namespace engine::select {
namespace {

constexpr std::size_t neighbours_joined = 8;  // the next ring of a surface
// A surface goes on where neighbours across the border are this much as alike as those within usually are: those of a
// cup and its table have 0.02 to 0.05, those of a cheek cut in two 0.3 to 1.
constexpr float goes_on = 0.3f;

}  // namespace

Contact contact_of(const scene::LayeredCloud& scene, std::span<const std::uint32_t> part,
                   std::span<const std::uint32_t> selected) {
  Contact out{std::vector<Touch>(part.size(), Touch::nothing)};
  const Around around = look_around(scene, part, neighbours_joined, Which::exposed);
  const neighbours::NeighbourGraph& graph = around.graph;
  const std::vector<std::uint8_t> is_selected = marked(around, selected), is_part = marked(around, part);

  constexpr float none = -1;
  std::vector<std::uint32_t> shown;   // indices into `part`, of what shows of it
  std::vector<float> across, within;  // how alike the likest neighbour is: not selected, and selected
  std::size_t k = 0;
  for (std::uint32_t node = 0; node < around.size(); ++node) {
    if (is_part[node] == 0) continue;
    while (part[k] != around.rows[node]) ++k;
    float inside = none, outside = none;
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
      if (!around.touches(node, edge)) continue;
      float& best = is_selected[graph.to[edge]] != 0 ? inside : outside;
      best = std::max(best, around.alike[edge]);
    }
    if (inside > none) within.push_back(inside);
    across.push_back(outside);
    shown.push_back(std::uint32_t(k));
  }
  const float usual = within.empty() ? 0 : median(std::move(within));
  out.shown = shown.size();
  if (usual > 0) out.firmness = firmness(graph, around.alike, is_part) / double(usual);
  for (std::size_t i = 0; i < shown.size(); ++i)
    out.touches[shown[i]] = across[i] == none                           ? Touch::nothing
                            : usual > 0 && across[i] >= goes_on * usual ? Touch::goes_on
                                                                        : Touch::stands;
  return out;
}

}  // namespace engine::select
