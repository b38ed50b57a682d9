// Where chosen Gaussians show in a picture.
#pragma once

#include <cstdint>
#include <span>

#include "engine/render/forward.h"
#include "engine/render/layers.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::working {

/// The part of the picture that splats of `rows` can touch at all, found from bounds on their size: never too small.
///   rows  of the layers, as render::Layers counts them
[[nodiscard]] scene::Rect touched_rect(const render::Layers& layers, std::span<const std::uint32_t> rows,
                                       const scene::Camera& camera);

/// Numbers of the rows, blended in every pixel of a rectangle as colours are. One channel, in the camera's size; 0
/// outside of the rectangle.
///   numbers    [layers.size()]
///   workspace  shared by the pictures of a loop, so that each does not allocate the scene's splats anew
[[nodiscard]] scene::Image blended(const render::Layers& layers, std::span<const float> numbers, scene::Rect rect,
                                   const scene::Camera& camera, render::Workspace& workspace);

/// The share that `rows` have in every pixel, 0 to 1, the rest of the scene in front of and behind them included: the
/// mask rendering of the paper, with members as colour 1. One channel, in the camera's size. Only touched_rect() is
/// rendered; the cost follows the part, not the picture.
[[nodiscard]] scene::Image footprint(const render::Layers& layers, std::span<const std::uint32_t> rows,
                                     const scene::Camera& camera, render::Workspace& workspace);

}  // namespace engine::working
