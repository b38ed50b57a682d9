// What the views of an edit showed before it.
#pragma once

#include <span>
#include <vector>

#include "engine/core/vec.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::repair {

struct UneditedViews {
  std::vector<scene::Image> color;         ///< [3] Per view.
  std::vector<scene::Image> median_depth;  ///< [1] Per view: of the first half of the light; 0: nothing.
};

/// Renders each view once.
[[nodiscard]] UneditedViews render_unedited(const scene::GaussianCloud& scene, std::span<const scene::Camera> views);

/// Have views looked through this point, so that nothing can be there? Two of them are needed: one alone may err at an
/// edge.
///   views  those that `unedited` was rendered from
[[nodiscard]] bool is_free(DVec3 point, const UneditedViews& unedited, std::span<const scene::Camera> views);

}  // namespace engine::repair
