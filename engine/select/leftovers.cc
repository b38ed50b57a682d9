#include "engine/select/leftovers.h"

#include <algorithm>
#include <cstddef>
#include <iterator>

namespace engine::select {
namespace {

// Chosen on captured cases of the choose set, by one click and by six (ADR 44). 0.35 to 0.7 of the first and 0.15 to
// 0.3 of the second give about the same.
constexpr double as_firmly = 0.5;
constexpr double border_weight = 0.15;  // of that of an edge within the thing
constexpr double of_thing = 0.15;       // more nodes than that are a thing of their own
constexpr float dies = 3e-4f;           // at each step: of what is far from the thing little is to be looked at
constexpr int levels = 9;               // a choice

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

/// A piece of what is not inside.
struct Piece {
  std::size_t nodes = 0, edges_to_rest = 0;
  double to_inside = 0, to_rest = 0;  ///< Weight of its edges.
  bool is_next_to_click = false;
};

/// Takes leftovers in, level by level.
class Leftovers {
 public:
  Leftovers(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
            std::span<const std::uint32_t> clicked, std::vector<std::uint8_t>& inside)
      : graph_(graph), weight_(weight), inside_(inside), was_clicked_(graph.size(), 0), number_(graph.size(), none) {
    for (const std::uint32_t node : clicked) was_clicked_[node] = 1;
    most_nodes_ = of_thing * double(std::count(inside.begin(), inside.end(), std::uint8_t{1}));
    most_weight_ = border_weight * weight_within(graph, weight, inside);
  }

  /// Those among the pieces that some nodes make up.
  ///   nodes  ascending, none of them inside
  void take(std::span<const std::uint32_t> nodes) {
    for (std::uint32_t i = 0; i < nodes.size(); ++i) number_[nodes[i]] = i;
    neighbours::Pieces pieces(nodes.size());
    for (std::uint32_t i = 0; i < nodes.size(); ++i)
      for (std::uint32_t edge = graph_.begin[nodes[i]]; edge < graph_.begin[nodes[i] + 1]; ++edge)
        if (const std::uint32_t other = number_[graph_.to[edge]]; other != none) pieces.join(i, other);
    std::vector<Piece> piece_at(nodes.size());  // by the number that `pieces` names one by
    for (std::uint32_t i = 0; i < nodes.size(); ++i) count(nodes[i], piece_at[pieces.of(i)]);
    for (std::uint32_t i = 0; i < nodes.size(); ++i) {
      number_[nodes[i]] = none;
      if (is_leftover(piece_at[pieces.of(i)])) inside_[nodes[i]] = 1;
    }
  }

 private:
  void count(std::uint32_t node, Piece& piece) const {
    ++piece.nodes;
    for (std::uint32_t edge = graph_.begin[node]; edge < graph_.begin[node + 1]; ++edge) {
      const std::uint32_t other = graph_.to[edge];
      piece.is_next_to_click = piece.is_next_to_click || was_clicked_[other] != 0;
      if (inside_[other] != 0)
        piece.to_inside += double(weight_[edge]);
      else if (number_[other] == none)
        piece.to_rest += double(weight_[edge]), ++piece.edges_to_rest;
    }
  }
  [[nodiscard]] bool is_leftover(const Piece& piece) const {
    return !piece.is_next_to_click && double(piece.nodes) <= most_nodes_ &&
           piece.to_inside > as_firmly * piece.to_rest && piece.to_rest <= most_weight_ * double(piece.edges_to_rest);
  }

  static constexpr std::uint32_t none = ~0u;

  const neighbours::NeighbourGraph& graph_;
  std::span<const float> weight_;
  std::vector<std::uint8_t>& inside_;
  std::vector<std::uint8_t> was_clicked_;  ///< [nodes]
  std::vector<std::uint32_t> number_;      ///< [nodes] Among those that are looked at; `none`: it is not.
  double most_nodes_ = 0, most_weight_ = 0;
};

}  // namespace

void take_leftovers(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
                    std::span<const Given> given, std::span<const std::uint32_t> clicked,
                    std::vector<std::uint8_t>& inside) {
  const std::vector<double> near = nearness(graph, weight, given, inside);
  const auto reaches = [&](std::uint32_t node, int level) { return near[node] > double(level) / (levels + 1); };
  std::vector<std::uint32_t> candidates;
  for (std::uint32_t node = 0; node < graph.size(); ++node)
    if (inside[node] == 0 && given[node] != Given::outside && reaches(node, 1)) candidates.push_back(node);
  Leftovers leftovers(graph, weight, clicked, inside);
  for (int level = levels; level > 0; --level) {
    std::vector<std::uint32_t> nodes;
    std::ranges::copy_if(candidates, std::back_inserter(nodes),
                         [&](std::uint32_t node) { return inside[node] == 0 && reaches(node, level); });
    if (!nodes.empty()) leftovers.take(nodes);
  }
}

}  // namespace engine::select
