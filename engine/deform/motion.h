// How the handles of a drag move the Gaussians around them.
// Source: 3DGS-Drag (ICLR 2025), section 3.3, eqs. 1 to 4, and appendix D, eqs. 8 to 10. Where a formula there is
// undefined or does not do what it says, the decision stands at the function.
//
// Everything here is in double, in any one frame; callers far from the origin pass positions relative to a point
// nearby.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/deform/choices.h"

namespace engine::deform {

/// K of the paper: how many handles a handle or a Gaussian looks at.
constexpr int neighbours = 2;

/// Two points closer than this (world units) are one point: no direction between them, and their weights are equal.
constexpr double coincident = 1e-12;

/// A handle in one interval: where it is and where it should go.
struct Drag {
  DVec3 source{0.0}, target{0.0};
  int group = 0;
  bool anchor = false;  ///< Holds its surroundings: does not move or turn; its target is not read.
  /// Unit. None: as the others suggest. With w < 0 it turns the long way, by more than half a turn. Read by
  /// Interpolation::arap, like those below.
  std::optional<DQuat> turn = {};
  double scale = 1;  ///< Of what it grips, above 0.
  double grip = 0;   ///< What is within, along the body, goes with it as one piece. World units.
};

/// A drag with its motion worked out.
struct HandleMotion {
  DVec3 source{0.0};
  DVec3 translation{0.0};              ///< dp = target - source
  DQuat rotation{1.0, 0.0, 0.0, 0.0};  ///< dq, unit; does not move the handle, only what is around it
  int group = 0;
};

/// Indices of nearby handles, nearest first, and their weights, which sum to 1. -1 (with weight 0): there is none.
struct Nearby {
  std::array<int, neighbours> handle{-1, -1};
  std::array<double, neighbours> weight{};
};

/// The K handles of `group` nearest to `point`, ties to the lower index, with the paper's weights
/// w_k = (1 - d_k^2 / sum_j d_j^2) / (K - 1).
/// One handle only: weight 1, where the formula would give 0. Sum below coincident^2: equal weights.
///   self  a handle that is no neighbour (of itself); -1: none
[[nodiscard]] Nearby nearby(DVec3 point, std::span<const HandleMotion> handles, int group, int self = -1);

/// dq_ik, the rotation that takes the direction `from` to the direction `to` (neither needs unit length).
/// A vector shorter than `coincident` has no direction: identity.
///   shortest_arc  [1 + s, r] normalised, s = from . to, r = from x to of the unit vectors. Exact reversal
///                 (1 + s < 1e-10): a half turn about from x e_m, m the smallest component of |from|.
///   paper         [s, r], negated if s < 0. Unit already, but it turns by twice the angle (by 2a - 360 degrees past
///   90).
[[nodiscard]] DQuat pair_rotation(DVec3 from, DVec3 to, Rotation rotation);

/// Translation and rotation of every handle: dp_i = target - source, dq_i = blend of the pair rotations to its K
/// nearest handles of the same group. A handle alone in its group does not turn. An anchor does neither. To blend is to
/// sum with the weights, each quaternion first brought to the hemisphere of the first, and to normalise; identity if
/// the sum is shorter than 1e-12.
[[nodiscard]] std::vector<HandleMotion> handle_motions(std::span<const Drag> drags, Rotation rotation);

/// Where a Gaussian goes.
struct GaussianMotion {
  DVec3 mean{0.0};                     ///< Its new mean.
  DQuat rotation{1.0, 0.0, 0.0, 0.0};  ///< Unit; the new quaternion is rotation * old (Hamilton).
};

/// Motion of a Gaussian of `group` among the handles of that group (at least one, asserted).
///   paper   mean + sum_k w_k dp_k over the K nearest; rotation = blend of the dq_k
///   smooth  the same sum over all handles of the group with w_k proportional to (max(0, R - d_k) / d_k)^2, where R is
///           1.5 times the distance of handle K + 1 (Franke and Little's inverse distance weights). These are
///           the paper's weights when the group has K handles, 1 on the handle, and continuous everywhere. They cannot
///           fade at handle K + 1 itself: a point equally far from three handles would be left with no weight at all.
///   rigid   sum_k w_k (target_k + rotate(dq_k, mean - source_k)), weights as smooth
/// The quaternions of smooth and rigid are summed in the hemisphere of the identity, so that the sum is continuous too.
/// The rotation is exactly (1, 0, 0, 0) if every handle that counts has that rotation; so is the translation exactly
/// zero.
[[nodiscard]] GaussianMotion gaussian_motion(DVec3 mean, std::span<const HandleMotion> handles, int group,
                                             Interpolation interpolation);

}  // namespace engine::deform
