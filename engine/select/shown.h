// Rows by what pictures show of them.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "engine/render/forward.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/select/operation.h"
#include "engine/select/shapes.h"

namespace engine::select {

/// `visible`: the rows that the camera shows, and that have more than half of their blending weight in the view inside
/// the outline. Shown is a row that makes up one 8-bit step (1/255) of some pixel, and to which a tenth of the light
/// gets through there: what shines through a surface is not meant. Two forward passes.
/// `through`: the rows that are projected into the outline from in front of the near plane.
/// Precondition: validate() holds, and all values of the cloud are finite.
[[nodiscard]] RowSet rows_in(const scene::GaussianCloud& cloud, const Polygon& polygon, render::Workspace& workspace);
[[nodiscard]] RowSet rows_in(const scene::GaussianCloud& cloud, const Stroke& stroke, render::Workspace& workspace);

/// What masks say of rows.
struct MaskedRows {
  RowSet inside;  ///< [N] 1 for rows that are judged to be inside.
  RowSet judged;  ///< [N] 1 where the masks say enough for a judgement, either way.
  RowSet
      shaded;  ///< [N] 1 for rows that are not judged because little light gets through to them, three fifths inside.
  /// Rows that the views show, of which the share inside lies within 0.1 of one half: masks that contradict each other,
  /// or a row across a border. Not judged.
  std::size_t undecided = 0;
};

/// Lifts masks to rows: inside is a row of which the views show more inside the masks than outside. Weights are summed
/// over all views, each in units of its picture's area, so that none counts for more by its resolution; pixels near a
/// mask's border (a fiftieth of the picture's width, or a tenth of the root of the mask's area if that is less) count
/// for either side by half, unless an opening of the mask by two thirds of that removes them: legs, stems, and corners.
/// What no view shows is not judged, nor a row to which less than a quarter of the light gets through in all of them:
/// where a hundredth does, three fifths of it inside, it is shaded. A forward pass for each view. Source: Shen et al.
/// 2024, "FlashSplat": which label of a row renders the masks best is known in closed form. Precondition: as above.
[[nodiscard]] MaskedRows rows_in_masks(const scene::GaussianCloud& cloud, const Masks& masks,
                                       render::Workspace& workspace);

/// The share of what a view shows that is made of these rows, 0 to 1: the sum of their blending weights by that of all.
/// 0 where it shows nothing.
///   rows  [cloud.size()]
/// Precondition: validate(camera) holds.
[[nodiscard]] double shown_share(const scene::GaussianCloud& cloud, std::span<const std::uint8_t> rows,
                                 const scene::Camera& camera, render::Workspace& workspace);
/// The same of each view.
[[nodiscard]] std::vector<double> shown_shares(const scene::GaussianCloud& cloud, std::span<const std::uint8_t> rows,
                                               std::span<const scene::Camera> cameras);

}  // namespace engine::select
