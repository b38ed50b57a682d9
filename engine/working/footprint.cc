#include "engine/working/footprint.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/render/project.h"

namespace engine::working {
namespace {

// A splat ends where opacity * exp(-q / 2) < 1 / 255; for opacity 1 that is sqrt(2 ln 255) = 3.33 standard deviations.
constexpr double extent = 3.34;

struct Box {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  bool empty = true;
  void add(double left, double top, double right, double bottom) {
    x0 = empty ? left : std::min(x0, left), y0 = empty ? top : std::min(y0, top);
    x1 = empty ? right : std::max(x1, right), y1 = empty ? bottom : std::max(y1, bottom);
    empty = false;
  }
};

int whole(double pixel, int limit) { return int(std::clamp(pixel, 0.0, double(limit))); }

}  // namespace

scene::Rect touched_rect(const render::Layers& layers, std::span<const std::uint32_t> rows,
                         const scene::Camera& camera) {
  Box box;
  for (const std::uint32_t of_layers : rows) {
    const bool is_base = of_layers < layers.base->size();
    const scene::GaussianCloud& cloud = is_base ? *layers.base : *layers.top;
    const std::size_t row = is_base ? of_layers : of_layers - layers.base->size();
    const DVec3 p = camera.cam_from_world(DVec3(cloud.mean.get(row)));
    // Rounding in the renderer may put a mean on the other side of the plane.
    if (p.z <= render::near_plane * (1 - 1e-4)) continue;
    const DVec2 center = camera.pixel_from_cam(p);
    const Vec3 log_scale = cloud.log_scale.get(row);
    const double log_sigma = std::clamp(double(std::max({log_scale.x, log_scale.y, log_scale.z})),
                                        -render::max_log_scale, render::max_log_scale);
    // |J sigma| for the perspective Jacobian J, plus the 0.3 square pixels of the screen filter.
    const double slant = 1 + (p.x * p.x + p.y * p.y) / (p.z * p.z);
    const double size = std::max(camera.fx, camera.fy) / p.z * std::exp(log_sigma);
    const double radius = extent * std::sqrt(size * size * slant + render::low_pass_px2) + 1;
    box.add(center.x - radius, center.y - radius, center.x + radius, center.y + radius);
  }
  if (box.empty) return {};
  const scene::Rect rect{whole(std::floor(box.x0), camera.width), whole(std::floor(box.y0), camera.height),
                         whole(std::ceil(box.x1), camera.width), whole(std::ceil(box.y1), camera.height)};
  return rect.empty() ? scene::Rect{} : rect;
}

scene::Image blended(const render::Layers& layers, std::span<const float> numbers, scene::Rect rect,
                     const scene::Camera& camera, render::Workspace& workspace) {
  scene::Image picture(camera.width, camera.height, 1);
  if (rect.empty()) return picture;
  render::ForwardOptions options;
  options.color = false;
  options.rect = rect;
  render::Rendering rendering;
  render::forward(layers, camera, options, numbers, workspace, rendering);
  for (int y = 0; y < rect.height(); ++y)
    std::copy_n(rendering.weight.data.begin() + std::ptrdiff_t(y) * rect.width(), rect.width(),
                picture.data.begin() + std::ptrdiff_t(rect.y0 + y) * picture.width + rect.x0);
  return picture;
}

scene::Image footprint(const render::Layers& layers, std::span<const std::uint32_t> rows, const scene::Camera& camera,
                       render::Workspace& workspace) {
  std::vector<float> member(layers.size(), 0.0f);
  for (const std::uint32_t row : rows) member[row] = 1.0f;
  return blended(layers, member, touched_rect(layers, rows, camera), camera, workspace);
}

}  // namespace engine::working
