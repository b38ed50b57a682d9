// The scalar backward pass: slow, obvious, and what the SIMD backend is judged by.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/render/backward.h"

namespace engine::render {

/// dL/d(picture), planes [height][width] of the camera's size. An empty one is zero.
template <std::floating_point Real>
struct ReferenceUpstream {
  std::array<std::vector<Real>, 3> color = {};
  std::vector<Real> depth = {}, alpha = {};
};

/// Gradients of R rows, in the precision of the computation.
template <std::floating_point Real>
struct ReferenceGradients {
  std::vector<std::array<Real, 3>> mean, log_scale;
  std::vector<std::array<Real, 4>> rotation;
  std::vector<Real> opacity_logit;
  std::vector<Real> sh;  ///< [R][3][sh_coefficients(degree of the layers)]
  std::vector<std::array<Real, 2>> mean2d_px;
};

/// Pulls back a whole picture on one thread. Every option but rect, tiles and backend is honoured.
///   rows  as in backward()
/// Sums over pixels run in double. With dense_nostop, a ray is followed until its transmittance leaves Real's range.
template <std::floating_point Real>
[[nodiscard]] ReferenceGradients<Real> backward_reference(const Layers& layers, const scene::Camera& camera,
                                                          const BackwardOptions& options,
                                                          const ReferenceUpstream<Real>& upstream,
                                                          std::span<const std::uint32_t> rows);

extern template ReferenceGradients<float> backward_reference(const Layers&, const scene::Camera&,
                                                             const BackwardOptions&, const ReferenceUpstream<float>&,
                                                             std::span<const std::uint32_t>);
extern template ReferenceGradients<double> backward_reference(const Layers&, const scene::Camera&,
                                                              const BackwardOptions&, const ReferenceUpstream<double>&,
                                                              std::span<const std::uint32_t>);

}  // namespace engine::render
