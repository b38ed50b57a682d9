// Densification: more Gaussians where the loss asks for them.
// Source: Kerbl et al. 2023, section 5.2; Rota Bulo et al. 2024, "Revising densification in Gaussian splatting",
// section 3.3, for the opacity of clones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/rng.h"
#include "engine/render/backward.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::train {

/// Sums of the lengths of dL/d(position of a splat in the picture), by which rows are chosen to get children.
struct PositionGradientStatistic {
  std::vector<double> sum;           ///< [R] Lengths of the gradient, positions in half pictures.
  std::vector<std::uint32_t> views;  ///< [R] Views that showed the row.

  void reset(std::size_t rows);
  /// Takes in one view.
  void add(const render::Gradients& gradients, const scene::Camera& camera);
  /// Rows with keep[i] != 0 stay, in order. keep: [R].
  void keep_rows(std::span<const std::uint8_t> keep);
};

/// Rows whose mean length over views exceeds the threshold, ascending: at most `max_rows`, those of the largest means
/// (the lower row if two tie).
[[nodiscard]] std::vector<std::uint32_t> rows_to_densify(const PositionGradientStatistic& statistic, double threshold,
                                                         std::size_t max_rows);

/// Logit of the opacity 1 - sqrt(1 - alpha), two of which, one behind the other, blend like the alpha of this logit.
[[nodiscard]] float halved_opacity(float logit);

/// Appends a child for each of `rows` (ascending), in their order, with the parent's extra bytes.
///   larger_than  world units: a Gaussian whose largest sigma exceeds this is split: it and its child take places drawn
///                from it, at 1 / 1.6 of its size. Others are cloned: both at the same place, with the opacity
///                1 - sqrt(1 - alpha), two of which blend like alpha
void add_children(scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows, double larger_than, Rng& rng);

}  // namespace engine::train
