// The scalar forward pass: slow, obvious, and what the SIMD backend is judged by.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/render/forward.h"
#include "engine/render/project.h"

namespace engine::render {

/// Pictures [height][width] (color: three of them), in the precision of the computation.
template <std::floating_point Real>
struct ReferencePictures {
  std::array<std::vector<Real>, 3> color;
  std::vector<Real> alpha, depth, median_depth, weight;
  std::vector<std::int32_t> contributions;  ///< How many splats were blended into each pixel.
};

/// Renders the whole picture on one thread. Every option of ForwardOptions but rect, tiles and backend is honoured.
///   weight  [layers.size()] or empty
template <std::floating_point Real>
[[nodiscard]] ReferencePictures<Real> forward_reference(const Layers& layers, const scene::Camera& camera,
                                                        const ForwardOptions& options, std::span<const Real> weight);

extern template ReferencePictures<float> forward_reference(const Layers&, const scene::Camera&, const ForwardOptions&,
                                                           std::span<const float>);
extern template ReferencePictures<double> forward_reference(const Layers&, const scene::Camera&, const ForwardOptions&,
                                                            std::span<const double>);

}  // namespace engine::render
