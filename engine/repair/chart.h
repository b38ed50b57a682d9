// A chart of a surface that goes on where nobody has seen it: a picture of it from straight in front, put together from
// what the views show around the place. What is completed there is one answer for all views, and no texture is drawn
// together as it is at a slant.
#pragma once

#include <optional>

#include "engine/repair/surfaces.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::repair {

/// A chart, and what views have shown of it so far.
struct Chart {
  scene::Camera camera;        ///< Faces the middle of what goes on.
  scene::Image inverse_depth;  ///< [1] Of the surface; 0: it is not known so far out.
  scene::Mask goes_on;         ///< Pixels where the surface goes on unseen, as far as the view that found it shows.
  scene::Image colors;         ///< [3] Sums of what views show, times their weights.
  scene::Image weights;        ///< [1] Sums of weights; 0: no view shows this pixel.
};

/// A chart of the surface that goes on at most pixels of a view, as finely as the view shows its middle; nothing where
/// hardly a pixel goes on, or where the view looks along the surface.
[[nodiscard]] std::optional<Chart> chart_of(const scene::Camera& view, const ContinuedSurfaces& surfaces);

/// What a view shows now.
struct Shown {
  const scene::Image& color;          ///< [3]
  const scene::Image& inverse_depth;  ///< [1] 0: nothing
  const scene::Mask& reliable;        ///< Pixels that may be relied upon.
};
/// Adds what a view shows of the surface itself: the more, the finer it shows it.
void add_view(Chart& chart, const scene::Camera& view, const Shown& shown);

/// Pixels that no view told anything of: where the surface goes on, and around that as far as its rim may reach.
///   rim_px  as for is_surrounded(), after all views were added
[[nodiscard]] scene::Mask untold_around(const Chart& chart, int rim_px);

/// Is what goes on known nearly all around?
///   rim_px  so near to it in the view that found it, no view told anything
[[nodiscard]] bool is_surrounded(const Chart& chart, int rim_px);

/// Pixels around what goes on, up to twice `rim_px` away, where the view that found it does not wholly show what
/// somebody has seen: outlines of the part were blurred there, and what is left lets through what is behind it. Where
/// nobody tells of the surface on one side it may end, and has no rim.
///   trust   [1] of the view
///   rim_px  as for is_surrounded(), after all views were added
[[nodiscard]] scene::Mask rim_of(const Chart& chart, const scene::Camera& view, const scene::Image& trust, int rim_px);

/// The mean of what was added; 0 where there is nothing. [3]
[[nodiscard]] scene::Image picture_of(const Chart& chart);

}  // namespace engine::repair
