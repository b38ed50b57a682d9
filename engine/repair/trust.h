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

/// How well the cameras have seen each row, 0 to 1: its largest blending weight over them, in parts of the one at
/// which a Gaussian counts as observed. Costs a forward pass per camera.
[[nodiscard]] std::vector<float> observed_rows(const scene::GaussianCloud& scene,
                                               std::span<const scene::Camera> cameras);

/// The trust of each row of the working scene, 0 to 1: that of the input's row it comes from, for a copy less where the
/// deformation has drawn it away from its neighbours. Originals that have left are not trusted; seeds are.
///   observed  [input rows], of observed_rows()
[[nodiscard]] std::vector<float> trust_of_rows(const WorkingScene& working, std::span<const float> observed, Mode mode);

}  // namespace engine::repair
