// One view that is trained on: what is frozen in it, and the pictures to come near to.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/render/frozen_view.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::train {

/// The Gaussians that stay as they are.
struct FrozenScene {
  const scene::GaussianCloud* base = nullptr;
  std::span<const std::uint32_t> hidden = {};  ///< Rows of the base that do not show: trained, or gone. Ascending.

  [[nodiscard]] render::Layers layers() const {
    render::Layers layers(*base);
    layers.hidden = hidden;
    return layers;
  }
};

/// A view under training. Its pictures are of `frozen.region()`, outside which nothing ever differs from the frozen
/// Gaussians' own picture.
struct TrainingView {
  render::FrozenView frozen;
  scene::Mask mask;                 ///< [whole picture] Pixels that may change.
  scene::Rect box;                  ///< The mask's bounding box in the whole picture; within the region.
  scene::Image background;          ///< I_o: the target outside the mask.
  scene::Image edited;              ///< I_e: the target inside the mask.
  std::vector<float> near_by_tile;  ///< [tiles of the picture] Depth of the nearest changeable Gaussian when the
                                    ///< correction began; 0: none in this tile.
  float nearest = 0;                ///< Smallest depth in near_by_tile; 0: none.
  std::uint64_t last_use = 0;       ///< Number of its last use among all uses of views.
};

/// The smallest rectangle that holds both.
[[nodiscard]] inline scene::Rect union_of(scene::Rect a, scene::Rect b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  return {std::min(a.x0, b.x0), std::min(a.y0, b.y0), std::max(a.x1, b.x1), std::max(a.y1, b.y1)};
}

/// A rectangle in the coordinates of a region.
[[nodiscard]] inline scene::Rect relative_to(scene::Rect rect, scene::Rect region) {
  return {rect.x0 - region.x0, rect.y0 - region.y0, rect.x1 - region.x0, rect.y1 - region.y0};
}

/// Is every pixel that a change of `reach` can matter to within the region?
[[nodiscard]] bool has_room(scene::Rect region, scene::Rect reach, const scene::Camera& camera);

/// The part of the picture, in whole tiles, that holds `reach` with some room to move in.
[[nodiscard]] scene::Rect region_around(scene::Rect reach, const scene::Camera& camera);

/// Gives the view a region that holds `reach` as well. Its pictures stay as they were in the old region, and show the
/// frozen Gaussians beyond it.
void widen(TrainingView& view, scene::Rect reach, const FrozenScene& frozen, Vec3 background);

/// Rounds to 8 bits a channel, as a stored picture is.
void quantise(scene::Image& image);

}  // namespace engine::train
