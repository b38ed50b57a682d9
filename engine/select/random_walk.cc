#include "engine/select/random_walk.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>

#include "engine/core/parallel.h"

namespace engine::select {
namespace {

constexpr std::size_t grain = 4'096;  // nodes of a parallel task: a choice

constexpr double accuracy = 1e-4;  // of the residual, relative to the right hand side, in the preconditioner's norm
constexpr int most_steps = 2'000;  // on the coarsest graph: far more than any scene has needed
constexpr int steps_when_refined = 40;        // on others, where they begin close to the solution
constexpr std::size_t coarse_enough = 2'000;  // nodes; a choice
constexpr double least_reduction = 0.8;       // of nodes by a coarser graph; with more left, it is not worth having

constexpr auto nobody = std::numeric_limits<std::uint32_t>::max();

/// A graph as the solver sees it. All spans live elsewhere.
struct Network {
  std::span<const std::uint32_t> begin, to;  ///< As those of NeighbourGraph.
  std::span<const float> weight;
  std::span<const Given> given;
  [[nodiscard]] std::size_t size() const { return given.size(); }
};

/// A graph of merged nodes.
struct Coarser {
  std::vector<std::uint32_t> begin, to;
  std::vector<float> weight;
  std::vector<Given> given;
  std::vector<std::uint32_t> merged;  ///< [nodes of the finer graph] the node it is part of
  [[nodiscard]] Network network() const { return {begin, to, weight, given}; }
};

/// Merges each free node with the free neighbour it is joined to most strongly, if that one is not merged yet, and all
/// nodes that are given for the same side.
std::vector<std::uint32_t> merge_pairs(const Network& fine, std::uint32_t& count) {
  std::vector<std::uint32_t> merged(fine.size(), nobody);
  std::array<std::uint32_t, 2> given{nobody, nobody};
  count = 0;
  for (std::uint32_t node = 0; node < fine.size(); ++node) {
    if (fine.given[node] != Given::no) {
      std::uint32_t& all = given[fine.given[node] == Given::inside ? 0 : 1];
      if (all == nobody) all = count++;
      merged[node] = all;
      continue;
    }
    if (merged[node] != nobody) continue;
    std::uint32_t partner = nobody;
    float strongest = 0;
    for (std::uint32_t edge = fine.begin[node]; edge < fine.begin[node + 1]; ++edge) {
      const std::uint32_t other = fine.to[edge];
      if (fine.given[other] != Given::no || merged[other] != nobody || !(fine.weight[edge] > strongest)) continue;
      strongest = fine.weight[edge];
      partner = other;
    }
    merged[node] = count;
    if (partner != nobody) merged[partner] = count;
    ++count;
  }
  return merged;
}

/// The graph with pairs of nodes merged, and the edges between merged nodes added up. Nothing if hardly any merge.
std::optional<Coarser> coarser(const Network& fine) {
  Coarser out;
  std::uint32_t count = 0;
  out.merged = merge_pairs(fine, count);
  if (double(count) > least_reduction * double(fine.size())) return std::nullopt;
  std::vector<std::uint32_t> first(count + 1, 0), members(fine.size());
  for (const std::uint32_t node : out.merged) ++first[node + 1];
  for (std::size_t node = 0; node < count; ++node) first[node + 1] += first[node];
  std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
  for (std::uint32_t node = 0; node < fine.size(); ++node) members[next[out.merged[node]]++] = node;

  out.given.resize(count);
  out.begin.push_back(0);
  std::vector<std::uint32_t> listed(count, nobody);  // where the edge to a node stands, if it is of the current one
  for (std::uint32_t node = 0; node < count; ++node) {
    const std::size_t own = out.to.size();
    for (std::uint32_t i = first[node]; i < first[node + 1]; ++i) {
      out.given[node] = fine.given[members[i]];
      for (std::uint32_t edge = fine.begin[members[i]]; edge < fine.begin[members[i] + 1]; ++edge) {
        const std::uint32_t other = out.merged[fine.to[edge]];
        if (other == node) continue;
        std::uint32_t& at = listed[other];
        if (at == nobody || at < own) {
          at = std::uint32_t(out.to.size());
          out.to.push_back(other);
          out.weight.push_back(0);
        }
        out.weight[at] += fine.weight[edge];
      }
    }
    out.begin.push_back(std::uint32_t(out.to.size()));
  }
  return out;
}

/// Runs body(node) for all nodes and adds up what it returns: the same bits for any number of threads.
template <class Body>
double sum_over(std::size_t nodes, Body&& body) {
  std::vector<double> sums(chunk_count(nodes, grain), 0.0);
  parallel_for(nodes, grain, [&](std::size_t begin, std::size_t end) {
    double sum = 0;
    for (std::size_t node = begin; node < end; ++node) sum += body(node);
    sums[begin / grain] = sum;
  });
  double all = 0;
  for (const double sum : sums) all += sum;
  return all;
}

/// Sum of the weights of a node's edges.
std::vector<double> degrees(const Network& network) {
  std::vector<double> out(network.size());
  for (std::size_t node = 0; node < out.size(); ++node)
    for (std::uint32_t edge = network.begin[node]; edge < network.begin[node + 1]; ++edge)
      out[node] += double(network.weight[edge]);
  return out;
}

/// Row of the Laplacian times x. Of x, values at given nodes count, too.
double laplacian(const Network& network, double degree, std::span<const double> x, std::size_t node) {
  double sum = degree * x[node];
  for (std::uint32_t edge = network.begin[node]; edge < network.begin[node + 1]; ++edge)
    sum -= double(network.weight[edge]) * x[network.to[edge]];
  return sum;
}

/// Makes x at the free nodes the mean of their neighbours': conjugate gradients, with the diagonal as preconditioner.
///   x  in: given values at given nodes, a guess at others
void solve(const Network& network, int steps, std::vector<double>& x) {
  const std::size_t n = network.size();
  const std::vector<double> degree = degrees(network);
  const auto is_free = [&](std::size_t node) { return network.given[node] == Given::no && degree[node] > 0; };
  std::vector<double> residual(n, 0.0), direction(n, 0.0), product(n, 0.0);
  const auto is_inside = [&](std::uint32_t node) { return network.given[node] == Given::inside; };
  const double right_hand_side = sum_over(n, [&](std::size_t node) {
    if (!is_free(node)) return 0.0;
    double sum = 0;
    for (std::uint32_t edge = network.begin[node]; edge < network.begin[node + 1]; ++edge)
      if (is_inside(network.to[edge])) sum += double(network.weight[edge]);
    return sum * sum / degree[node];
  });
  double size = sum_over(n, [&](std::size_t node) {
    if (!is_free(node)) return 0.0;
    residual[node] = -laplacian(network, degree[node], x, node);
    direction[node] = residual[node] / degree[node];
    return residual[node] * direction[node];
  });
  const double enough = accuracy * accuracy * right_hand_side;
  for (int step = 0; step < steps && size > enough; ++step) {
    const double curvature = sum_over(n, [&](std::size_t node) {
      if (!is_free(node)) return 0.0;
      product[node] = laplacian(network, degree[node], direction, node);
      return direction[node] * product[node];
    });
    if (!(curvature > 0)) break;  // rounding: nothing is left to gain
    const double length = size / curvature;
    const double next = sum_over(n, [&](std::size_t node) {
      if (!is_free(node)) return 0.0;
      x[node] += length * direction[node];
      residual[node] -= length * product[node];
      return residual[node] * residual[node] / degree[node];
    });
    const double share = next / size;
    sum_over(n, [&](std::size_t node) {
      if (is_free(node)) direction[node] = residual[node] / degree[node] + share * direction[node];
      return 0.0;
    });
    size = next;
  }
}

}  // namespace

std::vector<double> random_walk(const NeighbourGraph& graph, std::span<const float> weight,
                                std::span<const Given> given) {
  std::vector<Coarser> levels;  // ever coarser
  const Network finest{graph.begin, graph.to, weight, given};
  const auto network = [&](std::size_t level) { return level == 0 ? finest : levels[level - 1].network(); };
  while (network(levels.size()).size() > coarse_enough) {
    auto next = coarser(network(levels.size()));
    if (!next) break;
    levels.push_back(std::move(*next));
  }
  std::vector<double> x(network(levels.size()).size(), 0.0);
  for (std::size_t level = levels.size();; --level) {
    const Network here = network(level);
    for (std::size_t node = 0; node < here.size(); ++node)
      if (here.given[node] != Given::no) x[node] = here.given[node] == Given::inside ? 1.0 : 0.0;
    solve(here, level == levels.size() ? most_steps : steps_when_refined, x);
    if (level == 0) break;
    const std::vector<std::uint32_t>& merged = levels[level - 1].merged;
    std::vector<double> finer(merged.size());
    for (std::size_t node = 0; node < merged.size(); ++node) finer[node] = x[merged[node]];
    x = std::move(finer);
  }
  for (double& value : x) value = std::clamp(value, 0.0, 1.0);  // of rounding and of steps not taken
  return x;
}

}  // namespace engine::select
