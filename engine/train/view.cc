#include "engine/train/view.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/optim/losses.h"

namespace engine::train {
namespace {

// Pixels. Gaussians wander by a few pixels, and making a region anew costs a pass over the scene. A choice.
constexpr int spare_px = 2 * render::tile_size;

scene::Rect padded(scene::Rect rect, int by, const scene::Camera& camera) {
  if (rect.empty()) return rect;
  return {std::max(rect.x0 - by, 0), std::max(rect.y0 - by, 0), std::min(rect.x1 + by, camera.width),
          std::min(rect.y1 + by, camera.height)};
}

/// Copies a picture of the region `from_region` into one of a region that holds it.
void paste(const scene::Image& from, scene::Rect from_region, scene::Rect to_region, scene::Image& to) {
  const scene::Rect target = relative_to(from_region, to_region);
  for (int c = 0; c < from.channels; ++c)
    for (int y = 0; y < from.height; ++y)
      std::copy_n(from.plane(c).data() + std::ptrdiff_t(y) * from.width, from.width,
                  to.plane(c).data() + std::ptrdiff_t(target.y0 + y) * to.width + target.x0);
}

}  // namespace

bool has_room(scene::Rect region, scene::Rect reach, const scene::Camera& camera) {
  return union_of(region, padded(reach, optim::ssim_rim, camera)) == region;
}

scene::Rect region_around(scene::Rect reach, const scene::Camera& camera) {
  return render::whole_tiles(padded(reach, optim::ssim_rim + spare_px, camera), camera);
}

void widen(TrainingView& view, scene::Rect reach, const FrozenScene& frozen, Vec3 background) {
  const scene::Camera camera = view.frozen.camera();
  const scene::Rect before = view.frozen.region();
  view.frozen = render::FrozenView(frozen.layers(), camera, union_of(before, region_around(reach, camera)), background);
  scene::Image rounded = view.frozen.color();
  quantise(rounded);
  for (const auto& [picture, around] : {std::pair{&view.background, &view.frozen.color()}, {&view.edited, &rounded}}) {
    scene::Image wider = *around;
    paste(*picture, before, view.frozen.region(), wider);
    *picture = std::move(wider);
  }
}

void quantise(scene::Image& image) {
  constexpr std::size_t values_per_task = 65536;  // a choice
  parallel_for(image.data.size(), values_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      image.data[i] = std::round(std::clamp(image.data[i], 0.0f, 1.0f) * 255.0f) / 255.0f;
  });
}

}  // namespace engine::train
