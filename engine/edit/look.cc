#include "engine/edit/look.h"

#include <algorithm>

#include "engine/edit/footprint.h"
#include "engine/mask/mask.h"
#include "engine/views/views.h"

namespace engine::edit {
namespace {

// Longer side of the pictures on which views are compared: enough to rank them, a seventh of the pixels of a working
// one.
constexpr int comparison_side = 192;

/// Middle of all sources and targets, world units.
DVec3 middle_of(const Request& request) {
  DVec3 sum(0.0);
  for (const Handle& handle : request.handles) sum += handle.source + handle.target.value_or(handle.source);
  return sum / (2.0 * double(request.handles.size()));
}

DVec3 direction_to(DVec3 eye, DVec3 from) {
  const DVec3 offset = eye - from;
  const double distance = glm::length(offset);
  return distance > 0 ? offset / distance : DVec3(0.0);  // a camera on the handle looks from nowhere in particular
}

}  // namespace

std::vector<scene::Camera> candidate_cameras(const scene::GaussianCloud& input, std::span<const scene::Camera> dataset,
                                             const Request& request) {
  if (!dataset.empty()) return {dataset.begin(), dataset.end()};
  std::vector<DVec3> points;
  views::VirtualCameraOptions options;
  for (const Handle& handle : request.handles) {
    options.radius = std::max(options.radius, handle.radius);  // the dragged part itself is not in the way
    points.push_back(handle.source);
    if (handle.target) points.push_back(*handle.target);
  }
  options.count = request.params.views;
  options.up = request.up;
  options.width = options.height = request.params.max_image_side;
  return views::virtual_cameras(input, points, options);
}

Result<std::vector<double>> covered_areas(const WorkingScene& working, std::span<const std::uint32_t> rows,
                                          std::span<const scene::Camera> cameras,
                                          const std::function<Result<void>(double)>& advance) {
  std::vector<double> areas;
  render::Workspace workspace;
  for (const scene::Camera& camera : cameras) {
    const scene::Camera small = scene::fit_within(in_frame_of(working, camera), comparison_side);
    const scene::Mask covered = mask::mask2d(footprint(working.cloud, rows, small, workspace));
    areas.push_back(double(covered.area()) / double(covered.data.size()));
    if (auto going = advance(double(areas.size()) / double(cameras.size())); !going) return propagate(going);
  }
  return areas;
}

std::vector<scene::Camera> choose_views(std::span<const scene::Camera> cameras, std::span<const double> source_areas,
                                        std::span<const double> target_areas, const Request& request) {
  const DVec3 middle = middle_of(request);
  std::vector<views::Candidate> candidates;
  for (std::size_t i = 0; i < cameras.size(); ++i)
    candidates.push_back(
        {cameras[i].name, source_areas[i], target_areas[i], direction_to(cameras[i].centre(), middle)});
  std::vector<scene::Camera> chosen;
  for (const std::size_t i : views::choose_views(candidates, request.params.views, request.params.exclude_views))
    chosen.push_back(scene::fit_within(cameras[i], request.params.max_image_side));
  return chosen;
}

Result<void> unite_masks(const WorkingScene& working, std::span<const std::uint32_t> rows,
                         std::span<const scene::Camera> views, std::vector<scene::Mask>& masks,
                         const std::function<Result<void>(double)>& advance) {
  masks.resize(views.size());
  render::Workspace workspace;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (masks[v].data.empty()) masks[v] = scene::Mask(views[v].width, views[v].height);
    mask::unite(masks[v], mask::mask2d(footprint(working.cloud, rows, in_frame_of(working, views[v]), workspace)));
    if (auto going = advance(double(v + 1) / double(views.size())); !going) return going;
  }
  return {};
}

void dilate_masks(std::vector<scene::Mask>& masks) {
  for (scene::Mask& mask : masks) mask = mask::dilate(mask, mask::dilation_radius(mask.height));
}

}  // namespace engine::edit
