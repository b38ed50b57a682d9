// An elastic body between what grips it: each node with its surroundings turns as rigidly as possible, and turns like
// its neighbours do.
// Source: Sorkine and Alexa 2007, "As-rigid-as-possible surface modeling", eqs. 3 to 9; the term between rotations as
// in Levi and Gotsman 2015, "Smooth rotation enhanced as-rigid-as-possible mesh animation", eq. 4. Grips that are free
// to turn are our addition.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/elastic/embedding.h"

namespace engine::elastic {

/// Nodes that go as one: x_now = target + scale * turn * (x_rest - source).
struct Grip {
  std::vector<std::uint32_t> nodes;  ///< At least one. No node is in two grips.
  DVec3 source{0.0};                 ///< World units, as the graph.
};

/// Where a grip goes.
struct GripPose {
  DVec3 target{0.0};
  std::optional<DQuat> turn;  ///< Unit. None: it turns as suits the body best.
  double scale = 1;           ///< Above 0.
};

/// Where nodes are, and what is around them goes with: x_now = position + linear (x_rest - rest).
struct Pose {
  std::vector<DVec3> position;  ///< [M]
  std::vector<DQuat> turn;      ///< [M] unit
  std::vector<double> scale;    ///< [M] 1, but for nodes of grips that have another
};

struct SolverOptions {
  /// How much neighbours turn alike: 0 lets a body bend sharply at a point, large values make it stiff. Relative to the
  /// squared length of edges.
  double smoothness = 2;
  int most_iterations = 400;
  /// Of the energy's fall in one iteration, relative to the energy: less, and the body has settled.
  double settled = 1e-5;
};

/// Sum over the directed edges (i, j) of
///   w_ij (|p_i - p_j - scale_i R_i (g_i - g_j)|^2 + smoothness l^2 |R_i - R_j|^2),
/// l^2 the mean squared length of edges; g rest, p now. Units of length squared.
[[nodiscard]] double energy(const Graph& graph, const Pose& pose, double smoothness);

/// Finds poses of least energy. Its equations are factored once, so that another solve costs a fraction.
class Solver {
 public:
  /// Precondition: the graph is connected, and there is a grip.
  Solver(Graph graph, std::vector<Grip> grips, const SolverOptions& options = {});
  ~Solver();
  Solver(Solver&&) noexcept;
  Solver& operator=(Solver&&) noexcept;

  /// The pose at the end of a way: it settles at each stop, roughly at all but the last, and goes on from there. Where
  /// a body could turn one way or the other, it so turns the way it was taken.
  ///   way  stops, each [grips]; at least one
  ///   on_iteration  for tests: called with the energy after each iteration, and the stop it heads for
  [[nodiscard]] Pose solve(std::span<const std::vector<GripPose>> way,
                           const std::function<void(double energy, std::size_t stop)>& on_iteration = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The linear map that the surroundings of each node went through, stretch included: the least squares of its edges,
/// pulled towards turning (and the node's scale) alone where they say little, such as across a thin sheet.
[[nodiscard]] std::vector<DMat3> linear_maps(const Graph& graph, const Pose& pose);

}  // namespace engine::elastic
