#include "engine/repair/unedited_views.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/render/forward.h"

namespace engine::repair {
namespace {

// A view that sees by this share farther than a point has looked through it: depths of splats are no finer.
constexpr double seen_behind = 0.01;
constexpr int views_to_be_sure = 2;

}  // namespace

UneditedViews render_unedited(const scene::GaussianCloud& scene, std::span<const scene::Camera> views) {
  UneditedViews unedited;
  render::ForwardOptions options;
  options.depth = true;
  render::Workspace workspace;
  for (const scene::Camera& view : views) {
    render::Rendering rendering;
    render::forward(scene, view, options, {}, workspace, rendering);
    unedited.median_depth.push_back(std::move(rendering.median_depth));
    unedited.color.push_back(std::move(rendering.color));
  }
  return unedited;
}

bool is_free(DVec3 point, const UneditedViews& unedited, std::span<const scene::Camera> views) {
  int seen_through = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const DVec3 p = views[v].cam_from_world(point);
    if (p.z <= 0) continue;
    const DVec2 pixel = views[v].pixel_from_cam(p);
    const int x = int(std::floor(pixel.x)), y = int(std::floor(pixel.y));
    if (x < 1 || y < 1 || x >= views[v].width - 1 || y >= views[v].height - 1) continue;
    double nearest = 1e300;  // of the pixel and its neighbours: edges are a pixel wide
    for (int j = y - 1; j <= y + 1; ++j)
      for (int i = x - 1; i <= x + 1; ++i)
        if (const double depth = double(unedited.median_depth[v].at(i, j)); depth > 0)
          nearest = std::min(nearest, depth);
    if (nearest > p.z * (1 + seen_behind) && ++seen_through >= views_to_be_sure) return true;
  }
  return false;
}

}  // namespace engine::repair
