#include "engine/evaluate/round_trip.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/edit/edit.h"
#include "engine/mask/mask.h"
#include "engine/neighbours/point_index.h"
#include "engine/render/forward.h"
#include "engine/scene/overlay.h"
#include "engine/working/footprint.h"

namespace engine::evaluate {
namespace {

// Near its handle's point a Gaussian shows how far the handle has come; farther out others have a say.
constexpr double near_handle = 0.35;  // of the radius
// Most of what a handle has dragged lies within the radius with which it is taken back.
constexpr double held_again = 0.98;

/// Where each handle has come to.
std::vector<DVec3> places(const edit::Request& request, const edit::Report& report) {
  std::vector<DVec3> out;
  for (std::size_t i = 0; i < request.handles.size(); ++i)
    out.push_back(report.handles[i].relocated.empty() ? request.handles[i].source : report.handles[i].relocated.back());
  return out;
}

std::vector<DVec3> new_means(const scene::Overlay& overlay) {
  std::vector<DVec3> out;
  for (std::size_t row = overlay.changed.size(); row < overlay.rows.size(); ++row)
    out.emplace_back(overlay.rows.mean.get(row));
  return out;
}

/// Rows of what came out of `there`: those of the selected ones that stayed, and the copies of the others, which are
/// the first of all that is new.
///   copies  so many, at most
std::vector<std::uint32_t> selected_again(std::span<const std::uint32_t> selected, std::size_t input_rows,
                                          const scene::Overlay& there, std::size_t copies) {
  std::vector<std::uint32_t> out;
  for (const std::uint32_t row : selected) {
    const auto gone = std::ranges::lower_bound(there.removed, row);
    if (gone == there.removed.end() || *gone != row) out.push_back(row - std::uint32_t(gone - there.removed.begin()));
  }
  const auto first = std::uint32_t(input_rows - there.removed.size());
  for (std::uint32_t k = 0; k < std::min(copies, there.added()); ++k) out.push_back(first + k);
  return out;
}

/// From where the handles have come to, back to where they were, with radii that hold what they have dragged, which
/// may have been drawn apart.
///   moved  by the deformation alone: what an optimisation adds besides was not dragged
edit::Request reversed(const edit::Request& request, const edit::Report& report, const scene::Overlay& moved) {
  edit::Request back = request;
  const std::vector<DVec3> at = places(request, report);
  std::vector<std::vector<double>> distances(at.size());
  for (const DVec3& mean : new_means(moved)) {
    const auto nearer = [&](const DVec3& a, const DVec3& b) { return glm::distance(mean, a) < glm::distance(mean, b); };
    const auto nearest = std::min_element(at.begin(), at.end(), nearer);
    distances[std::size_t(nearest - at.begin())].push_back(glm::distance(mean, *nearest));
  }
  for (std::size_t i = 0; i < back.handles.size(); ++i) {
    edit::Handle& handle = back.handles[i];
    std::sort(distances[i].begin(), distances[i].end());
    if (handle.rotation) handle.rotation = glm::conjugate(*handle.rotation);
    if (handle.scale) handle.scale = 1 / *handle.scale;
    if (!distances[i].empty() && !request.selected)  // with a selection the radius is a grip
      handle.radius = std::max(handle.radius, distances[i][std::size_t(held_again * double(distances[i].size() - 1))]);
    if (handle.target) handle.target = std::exchange(handle.source, at[i]);
  }
  if (request.region) {  // what came here was within it before, wherever handles have carried it
    DVec3 low(1e300), high(-1e300);
    for (std::size_t i = 0; i < at.size(); ++i) {
      const DVec3 middle = request.region->center + at[i] - request.handles[i].source;
      low = glm::min(low, middle - request.region->size / 2.0),
      high = glm::max(high, middle + request.region->size / 2.0);
    }
    back.region = edit::Region{(low + high) / 2.0, high - low};
  }
  return back;
}

/// How far from where they should be Gaussians close to a handle's point find a new one, as a part of the drag.
double arrived(const scene::GaussianCloud& input, const edit::Request& request, const scene::Overlay& overlay) {
  const std::vector<DVec3> means = new_means(overlay);
  if (means.empty()) return 0;
  std::vector<float> points;
  for (const DVec3& mean : means)
    for (int axis = 0; axis < 3; ++axis) points.push_back(float(mean[axis]));
  const neighbours::PointIndex index(points, 3);
  double least = 1;
  for (const edit::Handle& handle : request.handles) {
    const double length = handle.target ? glm::distance(*handle.target, handle.source) : 0;
    if (length == 0) continue;
    std::vector<float> wanted;
    for (const std::uint32_t row : overlay.removed)
      if (const DVec3 mean(input.mean.get(row)); glm::distance(mean, handle.source) < near_handle * handle.radius)
        for (int axis = 0; axis < 3; ++axis) wanted.push_back(float((mean + *handle.target - handle.source)[axis]));
    if (wanted.empty()) continue;
    double off = 0;
    const auto nearest = index.nearest(wanted, 1);
    for (const neighbours::Neighbour& neighbour : nearest) off += std::sqrt(double(neighbour.squared_distance));
    least = std::min(least, 1 - off / double(nearest.size()) / length);
  }
  return least;
}

/// A camera between each of the views and the one nearest to it, each pair once.
std::vector<scene::Camera> cameras_between(std::span<const scene::Camera> views) {
  std::vector<scene::Camera> out;
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const std::size_t nearest = nearest_view(views, v);
    const std::pair<std::size_t, std::size_t> pair = std::minmax(v, nearest);
    if (nearest == v || std::find(pairs.begin(), pairs.end(), pair) != pairs.end()) continue;
    pairs.push_back(pair);
    out.push_back(between(views[pair.first], views[pair.second]));
  }
  return out;
}

/// Pixels that the changed rows of a scene dominate.
scene::Mask shown_change(const scene::GaussianCloud& input, const scene::Overlay& overlay, const scene::Camera& camera,
                         render::Workspace& workspace) {
  std::vector<std::uint32_t> gone = overlay.removed;
  gone.insert(gone.end(), overlay.changed.begin(), overlay.changed.end());
  std::sort(gone.begin(), gone.end());
  scene::Mask mask = mask::mask2d(working::footprint(input, gone, camera, workspace));
  const scene::GaussianCloud edited = scene::flatten(input, overlay);
  std::vector<std::uint32_t> added;
  for (std::size_t row = edited.size() - overlay.added(); row < edited.size(); ++row)
    added.push_back(std::uint32_t(row));
  mask::unite(mask, mask::mask2d(working::footprint(edited, added, camera, workspace)));
  return mask::dilate(mask, mask::dilation_radius(camera.height));
}

}  // namespace

Result<RegionQuality> zero_drag(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras,
                                const edit::Request& request, correct::Corrector* corrector) {
  edit::Request still = request;
  for (edit::Handle& handle : still.handles)
    if (!handle.is_anchor()) handle.target = handle.source, handle.rotation.reset(), handle.scale.reset();
  still.params.intervals = 1;
  still.params.optimise_unmoved = true;
  const auto outcome = edit::run(scene, cameras, still, {.corrector = corrector});
  if (!outcome) return propagate(outcome);
  const scene::GaussianCloud edited = scene::flatten(scene, outcome->overlay);
  RegionQualitySum inside;
  for (std::size_t v = 0; v < outcome->views.size(); ++v)
    inside.add(picture(edited, outcome->views[v]), picture(scene, outcome->views[v]), outcome->masks[v]);
  return inside.quality();
}

scene::Camera between(const scene::Camera& a, const scene::Camera& b) {
  scene::Camera out = a;
  out.name = a.name + "+" + b.name;
  const DQuat turn = glm::slerp(glm::quat_cast(a.rotation), glm::quat_cast(b.rotation), 0.5);
  out.rotation = glm::mat3_cast(glm::normalize(turn));
  out.translation = -(out.rotation * ((a.centre() + b.centre()) / 2.0));
  const double scale = double(a.width) / b.width;
  out.fx = (a.fx + scale * b.fx) / 2, out.fy = (a.fy + scale * b.fy) / 2;
  return out;
}

Result<RoundTrip> there_and_back(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras,
                                 const edit::Request& request, correct::Corrector* corrector) {
  const auto there = edit::run(scene, cameras, request, {.corrector = corrector});
  if (!there) return propagate(there);
  edit::Request deform_only = request;
  deform_only.params.iterations = 0;
  const auto dry = edit::run(scene, cameras, deform_only);
  if (!dry) return propagate(dry);
  RoundTrip trip;
  for (const edit::StageTime& time : there->report.times) trip.seconds += time.seconds;
  trip.arrived = arrived(scene, request, there->overlay);
  trip.halfway = scene::flatten(scene, there->overlay);
  edit::Request again = reversed(request, there->report, dry->overlay);
  if (again.selected)
    again.selected = selected_again(*again.selected, scene.size(), there->overlay, dry->overlay.added());
  const auto back = edit::run(trip.halfway, cameras, again, {.corrector = corrector});
  if (!back) return propagate(back);
  trip.back = scene::flatten(trip.halfway, back->overlay);

  trip.cameras = cameras_between(there->views);
  RegionQualitySum inside, outside;
  render::Workspace workspace;
  for (const scene::Camera& camera : trip.cameras) {
    const scene::Image is = picture(trip.back, camera), was = picture(scene, camera);
    const scene::Mask mask = shown_change(scene, there->overlay, camera, workspace);
    inside.add(is, was, mask);
    outside.add(is, was, complement(mask));
  }
  trip.inside = inside.quality(), trip.outside = outside.quality();
  return trip;
}

}  // namespace engine::evaluate
