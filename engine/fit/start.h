// The Gaussians that a fit begins with.
// Source: Kerbl et al. 2023, section 5.1 and the program published with it: isotropic Gaussians as large as the points
// around are near.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::fit {

/// World units; squares of what lies farther out are no floats any more.
constexpr double max_coordinate = 1e15;

/// A point of a sparse reconstruction.
struct ColoredPoint {
  DVec3 position{0.0};                ///< World units.
  std::array<std::uint8_t, 3> rgb{};  ///< Display-referred.
};

/// One Gaussian per point, in their order: opacity 0.1, the point's colour from everywhere, sigma the root mean square
/// distance to the three nearest other points. That is kept from 0 (points that coincide) and from what would cover
/// everything (points far from all others): within a factor of 1e4 below, and of 30 above, the median sigma.
///   points     finite, no coordinate beyond max_coordinate
///   sh_degree  of the result; bands beyond 0 are zero
[[nodiscard]] scene::GaussianCloud gaussians_at(std::span<const ColoredPoint> points, int sh_degree);

/// Points to begin with where nothing is known of the scene but its cameras: evenly random in the volume that they have
/// in common, grey. That is a ball around the place that their axes come nearest to, half as large as the cameras are
/// far away from it (the median), without what is not in the pictures of at least a third of the cameras, and of two.
///   cameras  may differ in anything
///   count    1 or more
///   errors   unprocessable, `where` is "cameras": fewer than two, axes that are parallel (they have no place in
///            common), or hardly any place in the pictures of enough of them
[[nodiscard]] Result<std::vector<ColoredPoint>> random_points(std::span<const scene::Camera> cameras, std::size_t count,
                                                              std::uint64_t seed);

/// The cloud with room for more bands (zero), or without those beyond `sh_degree`.
[[nodiscard]] scene::GaussianCloud with_sh_degree(const scene::GaussianCloud& cloud, int sh_degree);

}  // namespace engine::fit
