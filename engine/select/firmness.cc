#include "engine/select/firmness.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "engine/core/rows.h"
#include "engine/select/random_walk.h"

namespace engine::select {
namespace {

constexpr double kept = 0.5;    // of the part, at least: choices, both
constexpr double inmost = 0.2;  // of the part, from where walks begin

/// The nodes, by steps from the rest: the rest first.
std::vector<std::uint32_t> by_steps_from_rest(const neighbours::NeighbourGraph& graph,
                                              std::span<const std::uint8_t> is_part) {
  std::vector<std::uint32_t> order = rows_where(is_part, [](std::uint8_t part) { return part == 0; });
  std::vector<std::uint8_t> is_in(graph.size(), 0);
  for (const std::uint32_t node : order) is_in[node] = 1;
  for (std::size_t k = 0; k < order.size(); ++k)
    for (std::uint32_t edge = graph.begin[order[k]]; edge < graph.begin[order[k] + 1]; ++edge)
      if (const std::uint32_t other = graph.to[edge]; is_in[other] == 0) is_in[other] = 1, order.push_back(other);
  return order;
}

}  // namespace

double firmness(const neighbours::NeighbourGraph& graph, std::span<const float> alike,
                std::span<const std::uint8_t> is_part) {
  const std::vector<std::uint32_t> by_steps = by_steps_from_rest(graph, is_part);
  const auto rest = std::size_t(std::ranges::count(is_part, std::uint8_t{0}));
  const std::size_t reached = by_steps.size() - rest;
  if (rest == 0 || reached == 0) return 0;
  std::vector<Given> given(graph.size(), Given::no);
  const std::size_t core = by_steps.size() - std::max(std::size_t(inmost * double(reached)), std::size_t{1});
  for (std::size_t k = 0; k < rest; ++k) given[by_steps[k]] = Given::outside;
  for (std::size_t k = core; k < by_steps.size(); ++k) given[by_steps[k]] = Given::inside;
  std::vector<float> weight(alike.begin(), alike.end());
  for (float& one : weight) one = std::max(one, least_weight);
  const std::vector<double> potential = random_walk(graph, weight, given);

  std::vector<std::uint32_t> order(by_steps.begin() + std::ptrdiff_t(rest), by_steps.end());
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return potential[a] != potential[b] ? potential[a] > potential[b] : a < b;
  });
  std::vector<std::uint8_t> is_in(graph.size(), 0);
  double leaving = 0, weakest = std::numeric_limits<double>::infinity();
  std::ptrdiff_t edges = 0;  // that leave
  for (std::size_t i = 0; i < order.size(); ++i) {
    const std::uint32_t node = order[i];
    is_in[node] = 1;
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
      const std::uint32_t other = graph.to[edge];
      if (graph.length[edge] > neighbours::joining_spacings * std::min(graph.spacing[node], graph.spacing[other]))
        continue;  // a gap
      const int sign = is_in[other] != 0 ? -1 : 1;
      leaving += sign * double(alike[edge]), edges += sign;
    }
    const bool is_level = i + 1 == order.size() || potential[order[i + 1]] != potential[node];
    if (is_level && double(i + 1) >= kept * double(order.size()))
      weakest = std::min(weakest, edges > 0 ? leaving / double(edges) : 0.0);
  }
  return std::max(weakest, 0.0);
}

}  // namespace engine::select
