// What a 3 x 3 matrix does: where it turns, how far it stretches along which axes.
#pragma once

#include <array>

#include "engine/core/vec.h"

namespace engine {

/// m = u diag(s) v^T, s descending and not negative but for its last entry; u and v are rotations. Where m is flat, u
/// goes on as a rotation does.
struct Svd {
  DMat3 u, v;
  DVec3 s;
};

/// Source: Hestenes 1958, "Inversion of matrices by biorthogonalization": pairs of columns are turned until all are at
/// right angles.
[[nodiscard]] Svd decompose(DMat3 m);

using Matrix4 = std::array<std::array<double, 4>, 4>;

/// Symmetric: q^T N q = tr(R^T m) for the rotation R of a unit quaternion q = (w, x, y, z). The nearest rotation is the
/// eigenvector of its largest eigenvalue.
/// Source: Horn 1987, "Closed-form solution of absolute orientation using unit quaternions".
[[nodiscard]] Matrix4 horn_matrix(const DMat3& m);

/// The rotation R for which tr(R^T m) is largest: of all rotations the one nearest to m, and, for m the sum of
/// to from^T, the one that takes `from` to `to` with the least squares. Where several are (m is flat in two directions,
/// or mirrors two alike), one of them. Unit; identity where m is zero.
/// Source: Horn 1987, "Closed-form solution of absolute orientation using unit quaternions"; the eigenvalue by Newton's
/// steps as in Theobald 2005, "Rapid calculation of RMSDs using a quaternion-based characteristic polynomial".
[[nodiscard]] DQuat nearest_rotation(const DMat3& m);

}  // namespace engine
