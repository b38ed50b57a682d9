#include "engine/edit/masks.h"

#include <cassert>

#include "engine/mask/mask.h"
#include "engine/working/footprint.h"

namespace engine::edit {

Result<void> unite_masks(const working::WorkingScene& working, std::span<const std::uint32_t> rows,
                         std::span<const scene::Camera> views, std::vector<scene::Mask>& masks,
                         const std::function<Result<void>(double)>& advance) {
  assert(masks.size() == views.size());
  render::Workspace workspace;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const scene::Camera view = working.frame().edit_from_world(views[v]);
    mask::unite(masks[v], mask::mask2d(working::footprint(working.cloud(), rows, view, workspace)));
    if (auto going = advance(double(v + 1) / double(views.size())); !going) return going;
  }
  return {};
}

std::vector<scene::Mask> dilated(std::span<const scene::Mask> masks) {
  std::vector<scene::Mask> out;
  for (const scene::Mask& mask : masks) out.push_back(mask::dilate(mask, mask::dilation_radius(mask.height)));
  return out;
}

}  // namespace engine::edit
