// Step 5: the views an edit looks through.
// Source: 3DGS-Drag (ICLR 2025), section 4.1 for the number of views; the choice by what they see is ours.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/edit/parts.h"
#include "engine/edit/request.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/working/working_scene.h"

namespace engine::edit {

/// Pixels, longer side of the pictures on which views are compared: enough to rank them, a seventh of the pixels of a
/// working one.
constexpr int comparison_side = 192;

/// The cameras an edit may choose from: the dataset's, or a dome of virtual ones around sources and targets.
[[nodiscard]] std::vector<scene::Camera> candidate_cameras(const scene::GaussianCloud& input,
                                                           std::span<const scene::Camera> dataset,
                                                           const Request& request);

/// How many of them an edit looks through, if all see something of it.
[[nodiscard]] std::size_t views_at_most(std::span<const scene::Camera> candidates, const Params& params);

/// What is to be seen: the dragged part before the edit, and after the whole drag without corrections.
struct ViewChoice {
  std::vector<scene::Camera> views;  ///< Up to params.views, best first, scaled to the working picture size.
  std::vector<std::uint32_t>
      moved;  ///< Rows of the scene that it moves, or removes, ascending. None: it moves nothing.
  /// Candidates that show some of that where it is.
  std::vector<scene::Camera> witnesses;
};

/// Chooses views by the area that the part covers in them, at its source and at its target, and by their spread. The
/// target is where a dry run of the drag takes it; nothing is left of the dry run but the choice.
///   begun      the scene as the edit begins, its rows assigned
///   input      the same, of the world
///   intervals  T
///   advance    called after each small picture with the part that is done, 0 to 1; its error ends the choice
[[nodiscard]] Result<ViewChoice> choose_views(const working::WorkingScene& begun, const scene::GaussianCloud& input,
                                              std::span<const scene::Camera> candidates, const Request& request,
                                              const Parts& parts, int intervals,
                                              const std::function<Result<void>(double)>& advance);

}  // namespace engine::edit
