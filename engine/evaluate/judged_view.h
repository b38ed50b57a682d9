// What an edited scene is held against at one camera.
#pragma once

#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::evaluate {

/// The judged regions in one held-out view; pixels may lie in several.
struct JudgedRegions {
  scene::Mask edited, vacated, arrived, outside;
};

/// A held-out view. All have the camera's size.
struct JudgedView {
  scene::Camera camera;
  scene::Image truth;  ///< [3] What it should show, 0 to 1.
  JudgedRegions regions;
};

}  // namespace engine::evaluate
