// How far what a picture shows was really observed.
#pragma once

#include <span>
#include <vector>

#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/working/mode.h"
#include "engine/working/working_scene.h"

namespace engine::repair {

using working::Mode;
using working::WorkingScene;

/// The largest part of each row's light that came through what is in front of it, 0 to 1, over all pixels of the
/// cameras: about its largest blending weight in parts of its opacity. Costs a forward pass per camera.
[[nodiscard]] std::vector<float> shown_rows(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras);

/// How well cameras that have shown so much of each row (shown_rows()) have seen it, 0 to 1: in parts of the light at
/// which a Gaussian counts as observed.
[[nodiscard]] std::vector<float> observed_rows(std::vector<float> shown);

/// The trust of each row of the working scene, 0 to 1: that of the input's row it comes from, for a copy less where the
/// deformation has drawn it away from its neighbours. Originals that have left are not trusted; seeds are.
///   observed  [input rows], of observed_rows()
[[nodiscard]] std::vector<float> trust_of_rows(const WorkingScene& working, std::span<const float> observed, Mode mode);

}  // namespace engine::repair
