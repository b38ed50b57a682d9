// The motion of the handles, carried over to rows of a scene.
// Source: 3DGS-Drag (ICLR 2025), section 3.3, eqs. 3 and 4; turning the SH bands with the Gaussian is our addition.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/soa.h"
#include "engine/deform/motion.h"
#include "engine/deform/rigid.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::deform {

/// Where rows of a scene go, in the order of the rows asked for.
struct Deformation {
  Array3 mean;                      ///< New means.
  Array4 rotation;                  ///< New quaternions, of the length of the old ones.
  std::vector<DQuat> turn;          ///< The rotation by which the quaternion (and the SH bands) turned.
  std::vector<std::uint8_t> moves;  ///< 0: mean and quaternion come out as the very numbers they are now.
  /// 1: what is around the row does not only turn. Then its extents follow `map`, and its rotation comes from them.
  /// Empty, like `map`: nothing stretches.
  std::vector<std::uint8_t> stretches;
  std::vector<DMat3> map;

  [[nodiscard]] std::size_t size() const { return moves.size(); }
};

/// Where rows go that all follow one motion, their extents included.
[[nodiscard]] Deformation deformation(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                                      const RigidMotion& motion);

/// Takes entry k of `from`, which may lack extents, as entry at[k], for all k.
void scatter(const Deformation& from, std::span<const std::size_t> at, Deformation& into);

/// n rows that stay where they are, all of them with extents.
[[nodiscard]] Deformation at_rest(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows);

/// The deformation of `rows`, each with the handles of the group of the handle that owns it.
///   handle_of  [N] as assign() gives it; not 0 for any of the rows (asserted)
///   handles    [H] in the frame of the cloud
/// Computed in double, stored in float. A cloud far from its origin is worth moving into a frame near the handles
/// first.
[[nodiscard]] Deformation deformation(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                                      std::span<const std::uint16_t> handle_of, std::span<const HandleMotion> handles,
                                      Interpolation interpolation);

/// Writes entry k of the deformation to a row that holds a copy of the Gaussian it was computed for. Opacity, colour
/// seen along the Gaussian's own axes, the opaque bytes and, where nothing stretches, scale stay.
///   with_sh  also turn the SH bands 1 to 3; a turn of exactly nothing leaves their bytes alone
void apply(const Deformation& deformation, std::size_t k, bool with_sh, scene::GaussianCloud& cloud, std::size_t row);

}  // namespace engine::deform
