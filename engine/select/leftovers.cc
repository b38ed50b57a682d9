#include "engine/select/leftovers.h"

#include <algorithm>
#include <cstddef>

namespace engine::select {
namespace {

// Chosen on captured cases of the choose set, by one click and by six (ADR 44), where 0.35 to 0.7 and 0.15 to 0.3 give
// about the same.
constexpr double as_firmly = 0.5;  // by what is inside, by what holds it otherwise
// Of what neighbours inside weigh: within a surface, a border that is moved is no weaker than it was, and would move on
// and on.
constexpr double border_weight = 0.15;
constexpr double of_thing = 0.15;  // more nodes than that are a thing of their own
constexpr float dies = 3e-4f;      // at each step: of what is far from the thing little is to be looked at
constexpr int levels = 9;          // as few as find the pieces

/// How likely a walk from each node ends inside before it ends outside or dies.
std::vector<double> nearness(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
                             std::span<const Given> given, std::span<const std::uint8_t> inside) {
  std::vector<Given> ends(given.begin(), given.end());
  std::vector<float> leak(graph.size());
  for (std::uint32_t node = 0; node < graph.size(); ++node) {
    if (inside[node] != 0) ends[node] = Given::inside;
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge)
      leak[node] += dies * weight[edge];
  }
  return random_walk(graph, weight, ends, leak);
}

/// The weight of an edge within the thing, in the mean; 0 where there is none.
double weight_within(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
                     std::span<const std::uint8_t> inside) {
  double sum = 0;
  std::size_t count = 0;
  for (std::uint32_t node = 0; node < graph.size(); ++node) {
    if (inside[node] == 0) continue;
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge)
      if (inside[graph.to[edge]] != 0) sum += double(weight[edge]), ++count;
  }
  return count > 0 ? sum / double(count) : 0.0;
}

/// What may be taken in.
struct Limits {
  double nodes = 0;          ///< Most of a piece.
  double border_weight = 0;  ///< Most of an edge to what stays outside, in the mean.
};

/// A piece of what is not inside.
struct Piece {
  std::size_t nodes = 0, edges_to_rest = 0;
  double to_inside = 0, to_rest = 0;  ///< Weight of its edges.
  bool was_clicked = false;           ///< As outside, or next to what was.

  [[nodiscard]] bool is_leftover(const Limits& limits) const {
    return !was_clicked && double(nodes) <= limits.nodes && to_inside > as_firmly * to_rest &&
           to_rest <= limits.border_weight * double(edges_to_rest);
  }
};

/// Takes in the leftovers among the pieces that some nodes make up.
///   nodes        ascending, none of them inside
///   was_clicked  [n]
void take_pieces(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
                 std::span<const std::uint32_t> nodes, std::span<const std::uint8_t> was_clicked, const Limits& limits,
                 std::vector<std::uint8_t>& inside) {
  std::vector<std::uint8_t> is_among(graph.size(), 0);
  for (const std::uint32_t node : nodes) is_among[node] = 1;
  neighbours::Pieces pieces(graph.size());
  for (const std::uint32_t node : nodes)
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge)
      if (is_among[graph.to[edge]] != 0) pieces.join(node, graph.to[edge]);
  std::vector<Piece> of(graph.size());  // by the node that Pieces names them by
  for (const std::uint32_t node : nodes) {
    Piece& piece = of[pieces.of(node)];
    ++piece.nodes;
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
      const std::uint32_t other = graph.to[edge];
      piece.was_clicked = piece.was_clicked || was_clicked[other] != 0;
      if (inside[other] != 0)
        piece.to_inside += double(weight[edge]);
      else if (is_among[other] == 0)
        piece.to_rest += double(weight[edge]), ++piece.edges_to_rest;
    }
  }
  for (const std::uint32_t node : nodes)
    if (of[pieces.of(node)].is_leftover(limits)) inside[node] = 1;
}

}  // namespace

void take_leftovers(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
                    std::span<const Given> given, std::span<const std::uint32_t> clicked,
                    std::vector<std::uint8_t>& inside) {
  const auto size = double(std::count(inside.begin(), inside.end(), std::uint8_t{1}));
  const Limits limits{of_thing * size, border_weight * weight_within(graph, weight, inside)};
  const std::vector<double> near = nearness(graph, weight, given, inside);
  std::vector<std::uint8_t> was_clicked(graph.size(), 0);
  for (const std::uint32_t node : clicked) was_clicked[node] = 1;
  for (int k = levels; k > 0; --k) {
    std::vector<std::uint32_t> nodes;
    for (std::uint32_t node = 0; node < graph.size(); ++node)
      if (inside[node] == 0 && given[node] != Given::outside && near[node] > double(k) / (levels + 1))
        nodes.push_back(node);
    take_pieces(graph, weight, nodes, was_clicked, limits, inside);
  }
}

}  // namespace engine::select
