// Step 6: the 2D masks of an edit's views.
// Source: 3DGS-Drag (ICLR 2025), section 3.3, "Local Editing Mask".
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"
#include "engine/working/working_scene.h"

namespace engine::edit {

/// Unites the pixels that `rows` dominate (share at least one half) with the masks of the views, undilated.
///   views    of the world
///   masks    [views], in their sizes
///   advance  called after each view with the part that is done; its error ends it
[[nodiscard]] Result<void> unite_masks(const working::WorkingScene& working, std::span<const std::uint32_t> rows,
                                       std::span<const scene::Camera> views, std::vector<scene::Mask>& masks,
                                       const std::function<Result<void>(double)>& advance);

/// Each mask dilated by 10 px at 512 px of height. A dilation of a union is the union of the dilations, so once at the
/// end is enough.
[[nodiscard]] std::vector<scene::Mask> dilated(std::span<const scene::Mask> masks);

}  // namespace engine::edit
