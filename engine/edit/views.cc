#include "engine/edit/views.h"

#include <algorithm>
#include <utility>

#include "engine/edit/drag.h"
#include "engine/mask/mask.h"
#include "engine/render/layers.h"
#include "engine/views/views.h"
#include "engine/working/footprint.h"

namespace engine::edit {
namespace {

/// Middle of all sources and targets, world units.
DVec3 middle_of(const Request& request) {
  DVec3 sum(0.0);
  for (const Handle& handle : request.handles) sum += handle.source + handle.end();
  return sum / (2.0 * double(request.handles.size()));
}

DVec3 direction_to(DVec3 eye, DVec3 from) {
  const DVec3 offset = eye - from;
  const double distance = glm::length(offset);
  return distance > 0 ? offset / distance : DVec3(0.0);  // a camera on the handle looks from nowhere in particular
}

/// A scene with a drag laid over it, and what of it to look at.
struct DryRun {
  scene::GaussianCloud top;            ///< Originals, as they were lowered; then what the drag has added.
  std::vector<std::uint32_t> changed;  ///< Rows of the scene in whose place the originals are, ascending.
  std::vector<std::uint32_t> copies;   ///< At their final place: rows of the layers.
};

/// Where the whole drag would take the dragged rows: a function of what moves alone.
DryRun dry_run(const WorkingScene& begun, const scene::GaussianCloud& input, const Request& request, const Parts& parts,
               int intervals) {
  const DraggedAlone drag = drag_alone(input, begun.handle(), request, parts, intervals);
  const WorkingScene& alone = drag.working;

  const std::vector<std::uint32_t> originals = alone.rows_of(working::Role::original);
  DryRun out;
  for (const std::uint32_t row : originals) out.changed.push_back(drag.rows[row]);
  const std::uint32_t added_from = std::uint32_t(begun.size() + originals.size() - alone.input_rows());
  std::vector<std::uint32_t> taken = originals;
  for (auto row = std::uint32_t(alone.input_rows()); row < alone.size(); ++row) taken.push_back(row);
  for (auto row = std::uint32_t(alone.input_rows()); row < alone.size(); ++row)
    if (working::has_arrived(alone.role()[row])) out.copies.push_back(added_from + row);
  out.top = scene::gather(alone.cloud(), taken);
  return out;
}

/// Per camera of the world: the part of its picture, 0 to 1, that the rows cover. Measured on small pictures.
Result<std::vector<double>> covered_areas(const render::Layers& layers, const working::Frame& frame,
                                          std::span<const std::uint32_t> rows, std::span<const scene::Camera> cameras,
                                          const std::function<Result<void>(double)>& advance) {
  std::vector<double> areas;
  render::Workspace workspace;
  for (const scene::Camera& camera : cameras) {
    const scene::Camera small = scene::fit_within(frame.edit_from_world(camera), comparison_side);
    const scene::Mask covered = mask::mask2d(working::footprint(layers, rows, small, workspace));
    areas.push_back(double(covered.area()) / double(covered.data.size()));
    if (auto going = advance(double(areas.size()) / double(cameras.size())); !going) return propagate(going);
  }
  return areas;
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

std::size_t views_at_most(std::span<const scene::Camera> candidates, const Params& params) {
  const auto usable = std::ranges::count_if(candidates, [&](const scene::Camera& camera) {
    return std::ranges::find(params.exclude_views, camera.name) == params.exclude_views.end();
  });
  return std::min(std::size_t(usable), std::size_t(params.views));
}

Result<ViewChoice> choose_views(const WorkingScene& begun, const scene::GaussianCloud& input,
                                std::span<const scene::Camera> candidates, const Request& request, const Parts& parts,
                                int intervals, const std::function<Result<void>(double)>& advance) {
  DryRun dry = dry_run(begun, input, request, parts, intervals);
  ViewChoice choice;
  std::vector<std::uint32_t> sources_of = dry.changed;
  if (dry.changed.empty() && request.params.optimise_unmoved) dry.copies = sources_of = begun.dragged_rows();
  render::Layers layers(begun.cloud());
  layers.top = &dry.top;
  layers.hidden = layers.changed = dry.changed;
  const auto targets =
      covered_areas(layers, begun.frame(), dry.copies, candidates, [&](double part) { return advance(part / 2); });
  if (!targets) return propagate(targets);
  const auto sources = covered_areas(begun.cloud(), begun.frame(), sources_of, candidates,
                                     [&](double part) { return advance((1 + part) / 2); });
  if (!sources) return propagate(sources);

  for (std::size_t i = 0; i < candidates.size(); ++i)
    if ((*sources)[i] > 0) choice.witnesses.push_back(candidates[i]);
  choice.moved = std::move(dry.changed);

  const DVec3 middle = middle_of(request);
  std::vector<views::Candidate> rated;
  for (std::size_t i = 0; i < candidates.size(); ++i)
    rated.push_back({candidates[i].name, (*sources)[i], (*targets)[i], direction_to(candidates[i].centre(), middle)});
  for (const std::size_t i : views::choose_views(rated, request.params.views, request.params.exclude_views))
    choice.views.push_back(scene::fit_within(candidates[i], request.params.max_image_side));
  return choice;
}

}  // namespace engine::edit
