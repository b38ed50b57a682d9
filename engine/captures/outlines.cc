#include "engine/captures/outlines.h"

#include <vector>

#include "engine/mask/mask.h"

namespace engine::captures {

scene::Mask shown(const scene::GaussianCloud& cloud, std::span<const std::uint8_t> marks, const scene::Camera& camera,
                  render::Workspace& workspace) {
  const std::vector<float> weight(marks.begin(), marks.end());
  render::Rendering rendering;
  render::forward(cloud, camera, {.color = false}, weight, workspace, rendering);
  return mask::mask2d(rendering.weight);
}

scene::Mask true_outline(const CapturedCase& the_case, const scene::Camera& camera, render::Workspace& workspace) {
  return shown(the_case.before, the_case.moving.holds(the_case.before.mean), camera, workspace);
}

}  // namespace engine::captures
