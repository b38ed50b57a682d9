#include "engine/repair/witnesses.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "engine/render/forward.h"
#include "engine/scene/in_picture.h"

namespace engine::repair {
namespace {

// A point that lies by this share of its distance behind what a camera shows is hidden: depths of splats are no finer.
constexpr double hidden_behind = 0.01;
// Relative difference of depths up to which neighbouring pixels show one surface, seen at a slant.
constexpr double same_surface = 0.05;

/// The depth at a position within the picture: between the four pixels around it where they show one surface, whose
/// depth may change by more within a pixel than a hidden point is behind it; else that of the pixel it lies in.
double depth_at(const scene::Image& depth, DVec2 pixel) {
  const double here = double(depth.at(int(pixel.x), int(pixel.y)));
  const int x = int(std::floor(pixel.x - 0.5)), y = int(std::floor(pixel.y - 0.5));
  if (x < 0 || y < 0 || x + 1 >= depth.width || y + 1 >= depth.height) return here;
  const double corner[4] = {depth.at(x, y), depth.at(x + 1, y), depth.at(x, y + 1), depth.at(x + 1, y + 1)};
  const auto [least, most] = std::minmax_element(std::begin(corner), std::end(corner));
  if (!(*least > 0) || *most > (1 + same_surface) * *least) return here;
  const double u = pixel.x - 0.5 - x, v = pixel.y - 0.5 - y;
  return (1 - v) * ((1 - u) * corner[0] + u * corner[1]) + v * ((1 - u) * corner[2] + u * corner[3]);
}

/// Is there something beside the pixel that would hide a point at this depth?
bool is_at_edge(const scene::Image& depth, DVec2 pixel, double z) {
  const int x = int(pixel.x), y = int(pixel.y);
  for (int v = std::max(y - 1, 0); v <= std::min(y + 1, depth.height - 1); ++v)
    for (int u = std::max(x - 1, 0); u <= std::min(x + 1, depth.width - 1); ++u)
      if (const double beside = double(depth.at(u, v)); beside > 0 && z > beside * (1 + same_surface)) return true;
  return false;
}

}  // namespace

Witnesses::Witnesses(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras) {
  const std::size_t count = std::min(cameras.size(), most_witnesses);
  render::ForwardOptions options;
  options.depth = true;
  render::Workspace workspace;
  for (std::size_t k = 0; k < count; ++k) {
    cameras_.push_back(scene::fit_within(cameras[k * cameras.size() / count], witness_side));
    render::Rendering rendering;
    render::forward(scene, cameras_.back(), options, {}, workspace, rendering);
    depth_.push_back(std::move(rendering.median_depth));
  }
}

bool Witnesses::saw(DVec3 point) const {
  bool seen = false;
  for (std::size_t k = 0; k < cameras_.size(); ++k) {
    const scene::Camera& camera = cameras_[k];
    const DVec3 p = camera.cam_from_world(point);
    const auto pixel = pixel_in_picture(camera, p);
    if (!pixel) continue;
    const double depth = depth_at(depth_[k], *pixel);
    if (depth > 0 && p.z > depth * (1 + hidden_behind)) continue;
    if (seen || !is_at_edge(depth_[k], *pixel, p.z)) return true;
    seen = true;
  }
  return false;
}

}  // namespace engine::repair
