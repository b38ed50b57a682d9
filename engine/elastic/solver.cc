#include "engine/elastic/solver.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "engine/core/svd.h"

namespace engine::elastic {
namespace {

constexpr int free_node = -1;

double squared(DVec3 v) { return glm::dot(v, v); }

double mean_squared_length(const Graph& graph) {
  double sum = 0;
  for (std::uint32_t i = 0; i < graph.size(); ++i)
    for (std::uint32_t edge = graph.begin[i]; edge < graph.begin[i + 1]; ++edge)
      sum += squared(graph.rest[i] - graph.rest[graph.to[edge]]);
  return graph.to.empty() ? 0 : sum / double(graph.to.size());
}

/// |R_a - R_b|^2 (Frobenius) of unit quaternions: 8 (1 - <a, b>^2).
double apart(const DQuat& a, const DQuat& b) {
  const double cosine = glm::dot(a, b);
  return 8 * std::max(0.0, 1 - cosine * cosine);
}

}  // namespace

double energy(const Graph& graph, const Pose& pose, double smoothness) {
  const double coupling = smoothness * mean_squared_length(graph);
  double sum = 0;
  for (std::uint32_t i = 0; i < graph.size(); ++i) {
    const DMat3 map = pose.scale[i] * glm::mat3_cast(pose.turn[i]);
    for (std::uint32_t edge = graph.begin[i]; edge < graph.begin[i + 1]; ++edge) {
      const std::uint32_t j = graph.to[edge];
      const DVec3 off = pose.position[i] - pose.position[j] - map * (graph.rest[i] - graph.rest[j]);
      sum += graph.weight[edge] * (squared(off) + coupling * apart(pose.turn[i], pose.turn[j]));
    }
  }
  return sum;
}

/// Where the nodes are in between, with their energy.
struct Iterate {
  explicit Iterate(const Graph& graph)
      : pose{graph.rest, std::vector<DQuat>(graph.size(), DQuat(1, 0, 0, 0)), std::vector<double>(graph.size(), 1.0)},
        maps(graph.size(), DMat3(1.0)) {}
  Pose pose;
  std::vector<DMat3> maps;  ///< [M] scale * turn
  double energy = 0;
};

struct Solver::Impl {
  Graph graph;
  std::vector<Grip> grips;
  SolverOptions options;
  double coupling = 0;          ///< smoothness l^2
  std::vector<int> grip_of;     ///< [M] or free_node
  std::vector<int> unknown_of;  ///< [M] row of a free node in the equations
  std::vector<std::uint32_t> unknowns;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> equations;

  void factor();
  void place(std::size_t grip, const GripPose& at, Pose& pose) const;
  void turn_node(std::uint32_t i, std::span<DMat3> maps, Pose& pose) const;
  void turn_grip(std::size_t grip, const GripPose& at, std::span<DMat3> maps, Pose& pose) const;
  void place_free_nodes(std::span<const DMat3> maps, Pose& pose) const;
  void iterate(const std::vector<GripPose>& grip_poses, Iterate& now) const;
  void go_on(const Pose& before, double momentum, Iterate& now) const;

  /// Calls visit(j, weight) for the edges of node i.
  template <class Visit>
  void each_edge(std::uint32_t i, Visit&& visit) const {
    for (std::uint32_t edge = graph.begin[i]; edge < graph.begin[i + 1]; ++edge)
      visit(graph.to[edge], graph.weight[edge]);
  }
};

void Solver::Impl::factor() {
  const std::size_t n = graph.size();
  grip_of.assign(n, free_node);
  for (std::size_t k = 0; k < grips.size(); ++k)
    for (const std::uint32_t node : grips[k].nodes) grip_of[node] = int(k);
  unknown_of.assign(n, -1);
  for (std::uint32_t i = 0; i < n; ++i)
    if (grip_of[i] == free_node) unknown_of[i] = int(unknowns.size()), unknowns.push_back(i);
  if (unknowns.empty()) return;
  // d/dp_i: sum_j 2 w_ij (p_i - p_j) = sum_j w_ij (B_i + B_j) (g_i - g_j), B = scale R.
  std::vector<Eigen::Triplet<double>> entries;
  for (const std::uint32_t i : unknowns) {
    double diagonal = 0;
    each_edge(i, [&](std::uint32_t j, double weight) {
      diagonal += 2 * weight;
      if (grip_of[j] == free_node) entries.emplace_back(unknown_of[i], unknown_of[j], -2 * weight);
    });
    entries.emplace_back(unknown_of[i], unknown_of[i], diagonal);
  }
  const auto size = Eigen::Index(unknowns.size());
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  equations.compute(matrix);
  assert(equations.info() == Eigen::Success);  // connected to a grip, it is positive definite
}

void Solver::Impl::place(std::size_t grip, const GripPose& at, Pose& pose) const {
  for (const std::uint32_t i : grips[grip].nodes) {
    pose.turn[i] = at.turn.value_or(pose.turn[grips[grip].nodes.front()]);
    pose.scale[i] = at.scale;
    pose.position[i] = at.target + at.scale * (pose.turn[i] * (graph.rest[i] - grips[grip].source));
  }
}

/// The turn of a free node that suits it best as the others are.
void Solver::Impl::turn_node(std::uint32_t i, std::span<DMat3> maps, Pose& pose) const {
  DMat3 sum(0.0);
  each_edge(i, [&](std::uint32_t j, double weight) {
    sum += weight * (glm::outerProduct(pose.position[i] - pose.position[j], graph.rest[i] - graph.rest[j]) +
                     2 * coupling / pose.scale[j] * maps[j]);
  });
  pose.turn[i] = nearest_rotation(sum);
  maps[i] = glm::mat3_cast(pose.turn[i]);
}

/// The turn of a grip that suits it best as the others are: of its edges to nodes outside, in both directions.
void Solver::Impl::turn_grip(std::size_t grip, const GripPose& at, std::span<DMat3> maps, Pose& pose) const {
  const DVec3 source = grips[grip].source;
  DMat3 sum(0.0);
  bool has_neighbour = false;
  for (const std::uint32_t i : grips[grip].nodes)
    each_edge(i, [&](std::uint32_t j, double weight) {
      if (grip_of[j] == int(grip)) return;
      has_neighbour = true;
      const DVec3 arm = graph.rest[i] - source;
      sum += weight * at.scale *
             (glm::outerProduct(at.target - pose.position[j], source - graph.rest[j]) +
              glm::outerProduct(pose.position[j] - at.target - maps[j] * (graph.rest[j] - graph.rest[i]), arm));
      sum += weight * 2 * coupling / pose.scale[j] * maps[j];
    });
  if (!has_neighbour) return;
  GripPose turned = at;
  turned.turn = nearest_rotation(sum);
  place(grip, turned, pose);
  for (const std::uint32_t i : grips[grip].nodes) maps[i] = pose.scale[i] * glm::mat3_cast(pose.turn[i]);
}

void Solver::Impl::place_free_nodes(std::span<const DMat3> maps, Pose& pose) const {
  if (unknowns.empty()) return;
  Eigen::MatrixX3d right(Eigen::Index(unknowns.size()), 3);
  for (std::size_t row = 0; row < unknowns.size(); ++row) {
    const std::uint32_t i = unknowns[row];
    DVec3 sum(0.0);
    each_edge(i, [&](std::uint32_t j, double weight) {
      sum += weight * ((maps[i] + maps[j]) * (graph.rest[i] - graph.rest[j]));
      if (grip_of[j] != free_node) sum += 2 * weight * pose.position[j];
    });
    for (int axis = 0; axis < 3; ++axis) right(Eigen::Index(row), axis) = sum[axis];
  }
  const Eigen::MatrixX3d found = equations.solve(right);
  for (std::size_t row = 0; row < unknowns.size(); ++row)
    for (int axis = 0; axis < 3; ++axis) pose.position[unknowns[row]][axis] = found(Eigen::Index(row), axis);
}

/// Turns each node as suits it best, then places them all.
void Solver::Impl::iterate(const std::vector<GripPose>& grip_poses, Iterate& now) const {
  for (std::size_t k = 0; k < grips.size(); ++k)
    if (!grip_poses[k].turn) turn_grip(k, grip_poses[k], now.maps, now.pose);
  for (const std::uint32_t i : unknowns) turn_node(i, now.maps, now.pose);
  place_free_nodes(now.maps, now.pose);
  now.energy = energy(graph, now.pose, options.smoothness);
}

/// As far again as since `before`, times `momentum`: positions and turns of free nodes.
void Solver::Impl::go_on(const Pose& before, double momentum, Iterate& now) const {
  for (const std::uint32_t i : unknowns) {
    now.pose.position[i] += momentum * (now.pose.position[i] - before.position[i]);
    DQuat& turn = now.pose.turn[i];
    const DQuat last = glm::dot(turn, before.turn[i]) < 0 ? -before.turn[i] : before.turn[i];
    turn = glm::normalize(turn + momentum * (turn - last));
    now.maps[i] = glm::mat3_cast(turn);
  }
}

Solver::Solver(Graph graph, std::vector<Grip> grips, const SolverOptions& options) : impl_(std::make_unique<Impl>()) {
  assert(!grips.empty());
  impl_->graph = std::move(graph);
  impl_->grips = std::move(grips);
  impl_->options = options;
  impl_->coupling = options.smoothness * mean_squared_length(impl_->graph);
  impl_->factor();
}
Solver::~Solver() = default;
Solver::Solver(Solver&&) noexcept = default;
Solver& Solver::operator=(Solver&&) noexcept = default;

Pose Solver::solve(std::span<const std::vector<GripPose>> way,
                   const std::function<void(double, std::size_t)>& on_iteration) const {
  assert(!way.empty());
  const Impl& at = *impl_;
  Iterate now(at.graph);
  constexpr int on_the_way = 4;  // iterations at a stop that is not the last: enough to know which way to turn
  for (std::size_t stop = 0; stop < way.size(); ++stop) {
    assert(way[stop].size() == at.grips.size());
    for (std::size_t k = 0; k < at.grips.size(); ++k) {
      at.place(k, way[stop][k], now.pose);
      for (const std::uint32_t i : at.grips[k].nodes)
        now.maps[i] = now.pose.scale[i] * glm::mat3_cast(now.pose.turn[i]);
    }
    at.place_free_nodes(now.maps, now.pose);
    now.energy = energy(at.graph, now.pose, at.options.smoothness);
    Pose before = now.pose;
    int going = 0;  // iterations since momentum was lost
    for (int iteration = 0; iteration < (stop + 1 == way.size() ? at.options.most_iterations : on_the_way);) {
      // Where it is heading; from there its surroundings tell each node how to turn.
      Iterate next = now;
      const double momentum = double(going) / double(going + 3);
      if (going > 0) at.go_on(before, momentum, next);
      at.iterate(way[stop], next);
      ++iteration;
      if (on_iteration && !(next.energy > now.energy)) on_iteration(next.energy, stop);
      const double fall = now.energy - next.energy;
      const bool has_settled = !(fall > at.options.settled * now.energy);
      if (fall >= 0) before = std::exchange(now, std::move(next)).pose;
      if (has_settled && going == 0) break;
      going = has_settled ? 0 : going + 1;  // too far: the next one is without momentum, and never rises
    }
  }
  return now.pose;
}

std::vector<DMat3> linear_maps(const Graph& graph, const Pose& pose) {
  // Of the spread of a node's edges: decides where they span no direction, and quiets what little they say.
  constexpr double ridge = 0.02;
  std::vector<DMat3> maps(graph.size());
  for (std::uint32_t i = 0; i < graph.size(); ++i) {
    const DMat3 turned = pose.scale[i] * glm::mat3_cast(pose.turn[i]);
    DMat3 from(0.0), to(0.0);
    double spread = 0;
    for (std::uint32_t edge = graph.begin[i]; edge < graph.begin[i + 1]; ++edge) {
      const std::uint32_t j = graph.to[edge];
      const DVec3 rest = graph.rest[j] - graph.rest[i], now = pose.position[j] - pose.position[i];
      from += graph.weight[edge] * glm::outerProduct(rest, rest);
      to += graph.weight[edge] * glm::outerProduct(now, rest);
      spread += graph.weight[edge] * squared(rest);
    }
    maps[i] = turned;
    if (!(spread > 0)) continue;  // a node alone, or all in one place
    maps[i] = (to + ridge * spread * turned) * glm::inverse(from + ridge * spread * DMat3(1.0));
  }
  return maps;
}

}  // namespace engine::elastic
