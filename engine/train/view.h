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
struct Frozen {
  const scene::GaussianCloud* base = nullptr;
  std::span<const std::uint32_t> hidden = {};  ///< Rows of the base that are not among them, ascending.

  [[nodiscard]] render::Layers layers() const {
    render::Layers layers(*base);
    layers.hidden = hidden;
    return layers;
  }
};

/// Pictures are of `frozen.region()`, outside which nothing ever differs from the frozen Gaussians' own picture.
struct View {
  render::FrozenView frozen;
  scene::Mask mask;                 ///< Of the whole picture: what may be edited.
  scene::Rect box;                  ///< The mask's bounding box in the whole picture; within the region.
  scene::Image background;          ///< I_o: what is wanted outside the mask.
  scene::Image edited;              ///< I_e: what is wanted inside.
  std::vector<float> near_by_tile;  ///< [tiles of the picture] Depth of the nearest changeable Gaussian when the
                                    ///< correction began; 0: none in this tile.
  float nearest = 0;                ///< Of all of them.
  std::uint64_t used = 0;           ///< When it was last drawn, counted in drawings.
};

[[nodiscard]] inline scene::Rect united(scene::Rect a, scene::Rect b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  return {std::min(a.x0, b.x0), std::min(a.y0, b.y0), std::max(a.x1, b.x1), std::max(a.y1, b.y1)};
}

/// A rectangle in the coordinates of a region.
[[nodiscard]] inline scene::Rect within(scene::Rect rect, scene::Rect region) {
  return {rect.x0 - region.x0, rect.y0 - region.y0, rect.x1 - region.x0, rect.y1 - region.y0};
}

/// Is every pixel that a change of `reach` can matter to within the region?
[[nodiscard]] bool has_room(scene::Rect region, scene::Rect reach, const scene::Camera& camera);

/// The part of the picture that holds `reach` with some room to move in.
[[nodiscard]] scene::Rect region_around(scene::Rect reach, const scene::Camera& camera);

/// The view with a region that holds `reach` as well. Pictures stay what they were, and beyond are the frozen ones.
void widen(View& view, scene::Rect reach, const Frozen& frozen, Vec3 background);

/// Rounds to 8 bits a channel, as a stored picture is.
void quantise(scene::Image& image);

}  // namespace engine::train
