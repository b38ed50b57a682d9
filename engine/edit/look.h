// The views of an edit and their 2D masks.
// Source: 3DGS-Drag (ICLR 2025), section 3.1, "Local Editing Mask", and section 4.1 for the choice of views.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/edit/request.h"
#include "engine/edit/working_scene.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::edit {

/// The cameras an edit may choose from: the dataset's, or a dome of virtual ones around sources and targets.
[[nodiscard]] std::vector<scene::Camera> candidate_cameras(const scene::GaussianCloud& input,
                                                           std::span<const scene::Camera> dataset,
                                                           const Request& request);

/// Per camera: the part of its picture, 0 to 1, that the rows cover. Measured on small pictures.
///   advance  called after each camera with the part of the work that is done; its error ends the measurement
[[nodiscard]] Result<std::vector<double>> covered_areas(const WorkingScene& working,
                                                        std::span<const std::uint32_t> rows,
                                                        std::span<const scene::Camera> cameras,
                                                        const std::function<Result<void>(double)>& advance);

/// Up to params.views cameras by what they see of source and target and by their spread, best first, scaled to the
/// working picture size.
[[nodiscard]] std::vector<scene::Camera> choose_views(std::span<const scene::Camera> cameras,
                                                      std::span<const double> source_areas,
                                                      std::span<const double> target_areas, const Request& request);

/// Unites the pixels that `rows` dominate (share at least one half) with the masks of the views, undilated.
[[nodiscard]] Result<void> unite_masks(const WorkingScene& working, std::span<const std::uint32_t> rows,
                                       std::span<const scene::Camera> views, std::vector<scene::Mask>& masks,
                                       const std::function<Result<void>(double)>& advance);

/// Dilates each mask by 10 px at 512 px of height. A dilation of a union is the union of the dilations, so once at the
/// end is enough.
void dilate_masks(std::vector<scene::Mask>& masks);

}  // namespace engine::edit
