#include "engine/select/crumbs.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "engine/core/median.h"
#include "engine/neighbours/neighbour_graph.h"
#include "engine/select/around.h"

namespace engine::select {
namespace {

// Chosen on the captured cases board, mug, plant, mouth and turn (ADR 23): with eight neighbours the corners of the
// board fall apart; from 0.05 to 0.1 of what is usual, and from 0.15 to 0.3 of the border, they are found and next to
// nothing else is.
constexpr std::size_t neighbours_joined = 12;
constexpr float hangs_together = 0.07f;  // of how much neighbours in the part usually are alike
constexpr double of_border = 0.25;
constexpr double of_part = 0.03;       // more rows than that nobody leaves out by mistake
constexpr double rows_smaller = 0.98;  // of the part's: the rest may be blown up as well

float longest_log_scale(const scene::GaussianCloud& cloud, std::size_t row) {
  const Vec3 log_scale = cloud.log_scale.get(row);
  return std::max({log_scale.x, log_scale.y, log_scale.z});
}

/// How much a selected row is usually alike to the likest selected one beside it.
float usual_likeness(const Around& around, std::span<const std::uint8_t> is_selected) {
  std::vector<float> likest;
  for (std::uint32_t node = 0; node < around.size(); ++node) {
    if (is_selected[node] == 0) continue;
    float best = 0;
    for (std::uint32_t edge = around.graph.begin[node]; edge < around.graph.begin[node + 1]; ++edge)
      if (is_selected[around.graph.to[edge]] != 0) best = std::max(best, around.alike[edge]);
    likest.push_back(best);
  }
  return median(std::move(likest));
}

/// The extent that nearly all selected rows have at most.
float largest_log_scale(const Around& around, std::span<const std::uint8_t> is_selected) {
  std::vector<float> extents;
  for (std::size_t node = 0; node < around.size(); ++node)
    if (is_selected[node] != 0) extents.push_back(longest_log_scale(around.cloud, node));
  const auto at = extents.begin() + std::ptrdiff_t(rows_smaller * double(extents.size() - 1));
  std::nth_element(extents.begin(), at, extents.end());
  return *at;
}

/// Of a piece, at its lowest node: its edges to other nodes beside it.
struct Border {
  std::size_t to_part = 0, to_rest = 0;
  bool is_blown_up = false;  ///< Has the piece a row larger than those of the part?
};

std::vector<Border> borders_of(const Around& around, std::span<const std::uint8_t> is_selected,
                               neighbours::Pieces& pieces) {
  const float largest = largest_log_scale(around, is_selected);
  std::vector<Border> borders(around.size());
  for (std::uint32_t node = 0; node < around.size(); ++node) {
    if (is_selected[node] != 0) continue;
    const std::uint32_t piece = pieces.of(node);
    Border& border = borders[piece];
    border.is_blown_up |= longest_log_scale(around.cloud, node) > largest;
    for (std::uint32_t edge = around.graph.begin[node]; edge < around.graph.begin[node + 1]; ++edge) {
      const std::uint32_t other = around.graph.to[edge];
      if (!around.touches(node, edge)) continue;
      if (is_selected[other] != 0)
        ++border.to_part;
      else if (pieces.of(other) != piece)
        ++border.to_rest;
    }
  }
  return borders;
}

}  // namespace

std::vector<std::uint32_t> crumbs_of(const scene::LayeredCloud& scene, std::span<const std::uint32_t> selected) {
  if (selected.empty()) return {};
  const Around around = look_around(scene, selected, neighbours_joined);
  const neighbours::NeighbourGraph& graph = around.graph;
  const std::vector<std::uint8_t> is_selected = marked(around, selected);
  const float least = hangs_together * usual_likeness(around, is_selected);
  neighbours::Pieces pieces(around.size());
  for (std::uint32_t node = 0; node < around.size(); ++node)
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge)
      if (const std::uint32_t other = graph.to[edge];
          is_selected[node] == 0 && is_selected[other] == 0 && around.alike[edge] >= least)
        pieces.join(node, other);
  const std::vector<std::uint32_t> sizes = pieces.sizes();
  const std::vector<Border> borders = borders_of(around, is_selected, pieces);

  std::vector<std::uint32_t> out;
  for (std::uint32_t node = 0; node < around.size(); ++node) {
    const std::uint32_t piece = pieces.of(node);
    const Border& border = borders[piece];
    if (is_selected[node] != 0 || border.is_blown_up || border.to_part == 0) continue;
    const bool is_small = double(sizes[piece]) <= of_part * double(selected.size());
    if (is_small && double(border.to_part) >= of_border * double(border.to_part + border.to_rest))
      out.push_back(around.rows[node]);
  }
  return out;
}

}  // namespace engine::select
