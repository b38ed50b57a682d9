#include "engine/select/random_walk.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <deque>
#include <limits>
#include <optional>
#include <utility>

#include "engine/core/parallel.h"

namespace engine::select {
namespace {

constexpr std::size_t grain = 4'096;  // nodes of a parallel task: a choice

constexpr double accuracy = 1e-4;    // of the residual, relative to the right hand side, in the preconditioner's norm
constexpr int most_steps = 200;      // far more than any scene has needed
constexpr int steps_on_coarser = 2;  // on each but the finest and the coarsest graph, for each step on a finer one
constexpr double enough_on_coarser = 0.25;  // residual after which one of them will do
constexpr int steps_on_coarsest = 500;
constexpr double accuracy_on_coarsest = 1e-2;
constexpr std::size_t coarse_enough = 500;  // nodes; a choice
constexpr double least_reduction = 0.8;     // of nodes by a coarser graph; with more left, it is not worth having
constexpr double damping = 2.0 / 3;         // of the smoother: the diagonal alone would double what oscillates most

constexpr auto nobody = std::numeric_limits<std::uint32_t>::max();

/// A graph as the solver sees it. All spans live elsewhere.
struct Network {
  std::span<const std::uint32_t> begin, to;  ///< As those of neighbours::NeighbourGraph.
  std::span<const float> weight;
  std::span<const float> leak;  ///< [nodes] Weight of an edge to the outside.
  std::span<const Given> given;
  [[nodiscard]] std::size_t size() const { return given.size(); }
};

/// A graph of merged nodes.
struct Coarser {
  std::vector<std::uint32_t> begin, to;
  std::vector<float> weight, leak;
  std::vector<Given> given;
  std::vector<std::uint32_t> merged;  ///< [nodes of the finer graph] the node it is part of
  /// Those that node i is made of: members[first[i]] to members[first[i + 1]].
  std::vector<std::uint32_t> first, members;
  [[nodiscard]] Network network() const { return {begin, to, weight, leak, given}; }
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

/// Fills in the lists of members.
void list_members(std::size_t count, Coarser& out) {
  out.first.assign(count + 1, 0);
  out.members.resize(out.merged.size());
  for (const std::uint32_t node : out.merged) ++out.first[node + 1];
  for (std::size_t node = 0; node < count; ++node) out.first[node + 1] += out.first[node];
  std::vector<std::uint32_t> next(out.first.begin(), out.first.end() - 1);
  for (std::uint32_t node = 0; node < out.merged.size(); ++node) out.members[next[out.merged[node]]++] = node;
}

/// The graph with pairs of nodes merged, and the edges between merged nodes added up. Nothing if hardly any merge.
std::optional<Coarser> halved(const Network& fine) {
  Coarser out;
  std::uint32_t count = 0;
  out.merged = merge_pairs(fine, count);
  if (double(count) > least_reduction * double(fine.size())) return std::nullopt;
  list_members(count, out);
  out.given.resize(count);
  out.leak.assign(count, 0.0f);
  out.begin.push_back(0);
  std::vector<std::uint32_t> listed(count, nobody);  // where the edge to a node stands, if it is of the current one
  for (std::uint32_t node = 0; node < count; ++node) {
    const std::size_t own = out.to.size();
    for (std::uint32_t i = out.first[node]; i < out.first[node + 1]; ++i) {
      const std::uint32_t member = out.members[i];
      out.given[node] = fine.given[member];
      out.leak[node] += fine.leak[member];
      for (std::uint32_t edge = fine.begin[member]; edge < fine.begin[member + 1]; ++edge) {
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

/// The same, twice: four nodes become one.
std::optional<Coarser> coarser(const Network& fine) {
  auto half = halved(fine);
  if (!half) return std::nullopt;
  auto quarter = halved(half->network());
  if (!quarter) return half;
  for (std::uint32_t& node : half->merged) node = quarter->merged[node];
  quarter->merged = std::move(half->merged);
  list_members(quarter->given.size(), *quarter);
  return quarter;
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

/// A graph, and what the solver notes at its nodes. Nodes that are given, and those without edges, have an `inverse` of
/// 0, and all corrections there stay 0.
struct Level {
  explicit Level(const Network& of) : network(of), inverse(of.size(), 0.0) {
    for (std::vector<double>* each : {&right, &solution, &residual, &previous, &smoothed, &direction, &product})
      each->assign(of.size(), 0.0);
    parallel_for(of.size(), grain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t node = begin; node < end; ++node) {
        double degree = double(of.leak[node]);
        for (std::uint32_t edge = of.begin[node]; edge < of.begin[node + 1]; ++edge) degree += double(of.weight[edge]);
        if (of.given[node] == Given::no && degree > 0) inverse[node] = 1 / degree;
      }
    });
  }

  /// Row of the Laplacian times x, which is 0 at nodes that are not free.
  [[nodiscard]] double laplacian(std::span<const double> x, std::size_t node) const {
    double sum = x[node] / inverse[node];
    for (std::uint32_t edge = network.begin[node]; edge < network.begin[node + 1]; ++edge)
      sum -= double(network.weight[edge]) * x[network.to[edge]];
    return sum;
  }
  /// Runs body(node) for all free nodes and adds up what it returns.
  template <class Body>
  double sum_over_free(Body&& body) const {
    return sum_over(network.size(), [&](std::size_t node) { return inverse[node] > 0 ? body(node) : 0.0; });
  }
  template <class Body>
  void at_free(Body&& body) const {
    parallel_for(network.size(), grain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t node = begin; node < end; ++node)
        if (inverse[node] > 0) body(node);
    });
  }

  Network network;
  std::vector<double> inverse;  ///< One by the degree of a free node.
  std::vector<double> right, solution, residual, previous, smoothed, direction, product;
};

/// Solves for the values at which each free node is the mean of its neighbours: conjugate gradients, preconditioned by
/// a few steps of the same on a graph of a quarter of the nodes, and so on.
class Solver {
 public:
  explicit Solver(const Network& finest) {
    levels_.emplace_back(finest);
    while (levels_.back().network.size() > coarse_enough) {
      auto next = coarser(levels_.back().network);
      if (!next) break;
      coarser_.push_back(std::move(*next));
      levels_.emplace_back(coarser_.back().network());
    }
  }

  /// [nodes] 1 at nodes given for the inside, 0 at the others that are given.
  std::vector<double> solve() {
    Level& finest = levels_.front();
    const Network& network = finest.network;
    finest.at_free([&](std::size_t node) {
      double& sum = finest.right[node];
      for (std::uint32_t edge = network.begin[node]; edge < network.begin[node + 1]; ++edge)
        if (network.given[network.to[edge]] == Given::inside) sum += double(network.weight[edge]);
    });
    iterate(0, most_steps, accuracy);
    std::vector<double> out = std::move(finest.solution);
    for (std::size_t node = 0; node < out.size(); ++node)
      if (network.given[node] == Given::inside) out[node] = 1;
    return out;
  }

 private:
  /// Solves a level for its right hand side, from 0: flexible conjugate gradients (Notay 2000), for a preconditioner
  /// that is not the same at each step.
  ///   enough  residual at which to stop, relative to the first, in the preconditioner's norm
  void iterate(std::size_t number, int steps, double enough) {
    Level& level = levels_[number];
    std::fill(level.solution.begin(), level.solution.end(), 0.0);
    level.residual = level.right;
    double first = 0, last = 0;
    for (int step = 0; step < steps; ++step) {
      precondition(number);
      const double size = level.sum_over_free([&](std::size_t n) { return level.residual[n] * level.smoothed[n]; });
      if (step == 0) first = size;
      if (!(size > enough * enough * first)) break;  // also where there is nothing to do
      const double share = step == 0 ? 0.0 : 1 / last * level.sum_over_free([&](std::size_t n) {
        return level.smoothed[n] * (level.residual[n] - level.previous[n]);
      });
      level.at_free([&](std::size_t n) { level.direction[n] = level.smoothed[n] + share * level.direction[n]; });
      const double curvature = level.sum_over_free([&](std::size_t n) {
        level.product[n] = level.laplacian(level.direction, n);
        return level.direction[n] * level.product[n];
      });
      if (!(curvature > 0)) break;  // rounding: nothing is left to gain
      const double along = level.sum_over_free([&](std::size_t n) { return level.residual[n] * level.direction[n]; });
      const double length = along / curvature;
      level.at_free([&](std::size_t n) {
        level.solution[n] += length * level.direction[n];
        level.previous[n] = level.residual[n];
        level.residual[n] -= length * level.product[n];
      });
      last = size;
    }
  }

  /// level.smoothed: about what has to be added for the residual to vanish.
  void precondition(std::size_t number) {
    Level& level = levels_[number];
    const bool is_coarsest = number + 1 == levels_.size();
    const double share = is_coarsest ? 1 : damping;
    level.at_free([&](std::size_t n) { level.smoothed[n] = share * level.inverse[n] * level.residual[n]; });
    if (is_coarsest) return;
    level.at_free([&](std::size_t n) { level.product[n] = level.residual[n] - level.laplacian(level.smoothed, n); });
    const Coarser& how = coarser_[number];
    Level& below = levels_[number + 1];
    below.at_free([&](std::size_t n) {
      double sum = 0;
      for (std::uint32_t i = how.first[n]; i < how.first[n + 1]; ++i) sum += level.product[how.members[i]];
      below.right[n] = sum;
    });
    const bool is_last = number + 2 == levels_.size();
    iterate(number + 1, is_last ? steps_on_coarsest : steps_on_coarser,
            is_last ? accuracy_on_coarsest : enough_on_coarser);
    level.at_free([&](std::size_t n) { level.smoothed[n] += below.solution[how.merged[n]]; });
    level.at_free([&](std::size_t n) { level.product[n] = level.residual[n] - level.laplacian(level.smoothed, n); });
    level.at_free([&](std::size_t n) { level.smoothed[n] += damping * level.inverse[n] * level.product[n]; });
  }

  std::deque<Level> levels_;     ///< Ever coarser.
  std::deque<Coarser> coarser_;  ///< How each came to be, but the first; they stay where they are.
};

}  // namespace

std::vector<double> random_walk(const neighbours::NeighbourGraph& graph, std::span<const float> weight,
                                std::span<const Given> given, std::span<const float> leak) {
  std::vector<float> all(leak.begin(), leak.end());
  all.resize(graph.size(), 0.0f);
  std::vector<double> x = Solver({graph.begin, graph.to, weight, all, given}).solve();
  for (double& value : x) value = std::clamp(value, 0.0, 1.0);  // of rounding and of steps not taken
  return x;
}

}  // namespace engine::select
