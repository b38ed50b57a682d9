#include "engine/repair/part_shown.h"

#include <cstddef>

#include "engine/scene/in_picture.h"

namespace engine::repair {
namespace {

constexpr float covered = 0.5f;  // from this opacity of the part on a pixel shows it

}  // namespace

scene::Image where_shown(const render::Rendering& part, const render::Rendering& rest) {
  scene::Image shown(part.alpha.width, part.alpha.height, 1);
  for (std::size_t i = 0; i < shown.data.size(); ++i) {
    const float alpha = part.alpha.data[i], behind = rest.median_depth.data[i];
    shown.data[i] = alpha > covered && (behind == 0 || part.depth.data[i] < behind * alpha) ? 1.0f : 0.0f;
  }
  return shown;
}

void compare_depths(const Array3& means, const scene::Camera& view, const render::Rendering& part,
                    const scene::Image& shown, std::span<int> in_front, std::span<int> behind) {
  for (std::size_t row = 0; row < means.size(); ++row) {
    const DVec3 p = view.cam_from_world(means.get(row));
    const auto pixel = pixel_in_picture(view, p);
    if (!pixel) continue;
    const int x = int(pixel->x), y = int(pixel->y);
    if (shown.at(x, y) == 0) continue;
    ++(p.z * double(part.alpha.at(x, y)) < double(part.depth.at(x, y)) ? in_front : behind)[row];
  }
}

}  // namespace engine::repair
