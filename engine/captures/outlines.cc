#include "engine/captures/outlines.h"

#include <cstdint>

#include "engine/core/rows.h"
#include "engine/mask/mask.h"
#include "engine/render/forward.h"
#include "engine/working/footprint.h"

namespace engine::captures {

std::vector<scene::Mask> true_outlines(const CapturedCase& the_case, std::span<const scene::Camera> cameras) {
  const std::vector<std::uint32_t> rows = marked_rows(the_case.moving.holds(the_case.before.mean));
  std::vector<scene::Mask> out;
  render::Workspace workspace;
  for (const scene::Camera& camera : cameras)
    out.push_back(mask::mask2d(working::footprint(the_case.before, rows, camera, workspace)));
  return out;
}

}  // namespace engine::captures
