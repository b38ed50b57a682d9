// What of a scene hangs as a veil before a part that has arrived.
//
// A trained scene has Gaussians that float before its floors and walls. Nobody sees them there, as they have the colour
// of what is behind them; but a thing that is set down on such a floor is covered by them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/render/forward.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/working/working_scene.h"

namespace engine::repair {

using working::WorkingScene;

/// Frozen rows of the working scene that are a veil: most of their light falls on the part where what is solid of the
/// rest is behind it, and did not where the part came from: there they are a layer of what the part grows out of.
/// Ascending. None where they all take less of the part's light than anybody sees, nor where the scene without them
/// looks otherwise: what shows there, such as a net or glass, is no veil. Three forward passes for each of at most a
/// dozen of the views, and five more where there may be a veil.
///   original  the scene as the edit found it, in the frame of the edit: input_rows() rows (asserted)
///   left      rows of it that have left their place, ascending
///   arrived   rows of the working scene where they have come to, ascending
///   views     in that frame
[[nodiscard]] std::vector<std::uint32_t> veils_before(const WorkingScene& working, const scene::GaussianCloud& original,
                                                      std::span<const std::uint32_t> left,
                                                      std::span<const std::uint32_t> arrived,
                                                      std::span<const scene::Camera> views,
                                                      render::Workspace& workspace);

}  // namespace engine::repair
