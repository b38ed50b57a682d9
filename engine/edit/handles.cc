#include "engine/edit/handles.h"

#include <algorithm>
#include <limits>

#include "engine/deform/intervals.h"
#include "engine/deform/path.h"
#include "engine/deform/rigid.h"
#include "engine/render/project.h"

namespace engine::edit {
namespace {

/// Nearer than this many times their own extent, handles are edited in the world's frame, which costs no rounding at
/// all. Beyond, the world's floats are coarser than those of a frame around the handles.
constexpr double far_away = 16;

}  // namespace

int resolved_intervals(const Request& request) {
  if (request.mode == Mode::remove) return 1;  // there is no way to go
  if (request.params.intervals > 0) return request.params.intervals;
  // A body finds its whole way at once.
  if (request.params.interpolation == Interpolation::arap) return 1;
  // What an extend leaves along its way is as long as the part is: its sphere's diameter. More intervals than close the
  // gap only lay half-transparent layers of it over each other.
  const double step = request.mode == Mode::extend ? 2 : 1;
  std::vector<deform::DragLength> drags;
  for (const Handle& handle : request.handles)
    drags.push_back({glm::distance(handle.end(), handle.source), step * handle.radius});
  return deform::default_intervals(drags);
}

bool one_interval_is_exact(const Request& request) {
  const Params& params = request.params;
  if (params.interpolation == Interpolation::arap) return true;
  if (params.interpolation != Interpolation::rigid || params.rotation != Rotation::shortest_arc) return false;
  std::vector<deform::Drag> drags;
  for (const Handle& handle : request.handles)
    drags.push_back({handle.source, handle.end(), handle.group, handle.is_anchor()});
  const auto goes_whole = [&](const deform::Drag& drag) {
    const bool is_held = std::any_of(drags.begin(), drags.end(), [&](const deform::Drag& other) {
      return other.anchor && other.group == drag.group;
    });
    return drag.anchor || (!is_held && deform::moves_as_one_piece(drags, drag.group));
  };
  return !drags.empty() && std::all_of(drags.begin(), drags.end(), goes_whole);
}

working::Frame frame_of(const Request& request) {
  DVec3 low(request.handles.front().source), high(low);
  double reach = 0;
  for (const Handle& handle : request.handles) {
    for (const DVec3& point : {handle.source, handle.end()}) low = glm::min(low, point), high = glm::max(high, point);
    reach = std::max(reach, handle.radius);
  }
  const DVec3 middle = (low + high) / 2.0;
  if (glm::length(middle) <= far_away * (glm::distance(low, high) + reach)) return {};
  return working::Frame(DVec3(Vec3(middle)));
}

std::vector<DVec3> handle_sources(const working::Frame& frame, const Request& request) {
  std::vector<DVec3> positions;
  for (const Handle& handle : request.handles) positions.push_back(frame.edit_from_world(handle.source));
  return positions;
}

std::vector<DVec3> in_world(const working::Frame& frame, std::span<const DVec3> positions) {
  std::vector<DVec3> out;
  for (const DVec3& position : positions) out.push_back(frame.world_from_edit(position));
  return out;
}

void give_radii(const scene::Bounds& selected, Request& request) {
  const DVec3 size = DVec3(selected.high) - DVec3(selected.low);
  if (request.mode == Mode::remove && request.handles.empty())
    request.handles.emplace_back().source = (DVec3(selected.low) + DVec3(selected.high)) / 2.0;
  const double longest = std::max({size.x, size.y, size.z});
  const bool is_body = request.params.interpolation == Interpolation::arap;
  double way = 0;
  for (const Handle& handle : request.handles) way = std::max(way, glm::distance(handle.end(), handle.source));
  for (Handle& handle : request.handles) {
    if (handle.radius != 0) continue;
    const double share = !is_body ? 0.5 : handle.rotation || handle.scale ? 0.25 : 0.05;
    handle.radius = share * longest;
    if (!(handle.radius > 0)) handle.radius = way > 0 ? way : 1;  // a single Gaussian: it goes all the way in one step
  }
}

double grip_of(const Request& request, const Handle& handle) {
  // Without a selection the radius says what moves: were all of that gripped, nothing of it would bend.
  constexpr double of_a_sphere = 0.25;
  return request.selected ? handle.radius : of_a_sphere * handle.radius;
}

std::vector<deform::Drag> whole_drags(const Request& request, const working::Frame& frame) {
  std::vector<deform::Drag> drags;
  for (const Handle& handle : request.handles) {
    deform::Drag drag{frame.edit_from_world(handle.source), frame.edit_from_world(handle.end()), handle.group,
                      handle.is_anchor()};
    if (handle.rotation) drag.turn = *handle.rotation / glm::length(*handle.rotation);
    drag.scale = handle.scale.value_or(1);
    drag.grip = grip_of(request, handle);
    drags.push_back(drag);
  }
  return drags;
}

std::vector<deform::Drag> interval_drags(const working::Frame& frame, const Request& request,
                                         std::span<const Parts::Corrected> corrected, std::span<const DVec3> positions,
                                         int u, int intervals) {
  std::vector<deform::Drag> drags = whole_drags(request, frame);
  for (const auto& [handle, target] : corrected) drags[handle].target = frame.edit_from_world(target);
  const deform::Path path(drags);
  const double before = double(u - 1) / intervals, now = double(u) / intervals;
  for (std::size_t i = 0; i < drags.size(); ++i) {
    deform::Drag& drag = drags[i];
    if (!drag.anchor)
      drag.target = request.params.interpolation == Interpolation::arap
                        ? path.position(i, now)
                        : deform::interval_target(drag.source, drag.target, u, intervals);
    drag.source = positions[i];
    if (drag.anchor) drag.target = drag.source;
    if (drag.turn && intervals > 1) drag.turn = *path.turn(i, now) * glm::conjugate(*path.turn(i, before));
    if (intervals > 1) drag.scale = path.scale(i, now) / path.scale(i, before);
  }
  return drags;
}

namespace {

/// How far from a handle rows tell where it went. An elastic body goes its own way everywhere, so that only those tell
/// that the handle grips, or else the nearest one; a handle of other interpolations goes with all that are its own.
std::vector<double> telling_distances(const working::WorkingScene& working, const Request& request,
                                      std::span<const DVec3> positions) {
  if (request.params.interpolation != Interpolation::arap)
    return std::vector<double>(positions.size(), std::numeric_limits<double>::infinity());
  std::vector<double> nearest(positions.size(), std::numeric_limits<double>::infinity());
  for (std::size_t row = 0; row < working.size(); ++row) {
    if (working.handle()[row] == 0) continue;
    const std::size_t i = working.handle()[row] - 1u;
    nearest[i] = std::min(nearest[i], glm::distance(DVec3(working.mean_at_deform().get(row)), positions[i]));
  }
  for (std::size_t i = 0; i < positions.size(); ++i)
    nearest[i] = std::max(nearest[i], grip_of(request, request.handles[i]));
  return nearest;
}

}  // namespace

std::vector<std::size_t> relocate(const working::WorkingScene& working, const Request& request,
                                  std::vector<DVec3>& positions) {
  const std::vector<double> telling = telling_distances(working, request, positions);
  struct Mean {
    DVec3 moved{0.0};  ///< Weighted sum.
    double weight = 0;
  };
  std::vector<Mean> near(positions.size()), all(positions.size());
  for (std::size_t row = 0; row < working.size(); ++row) {
    if (working.handle()[row] == 0) continue;
    const std::size_t i = working.handle()[row] - 1u;
    const DVec3 before(working.mean_at_deform().get(row));
    const double alpha = render::opacity<double>(working.cloud().opacity_logit[row]);
    for (Mean* mean : {&near[i], &all[i]}) {
      if (mean == &near[i] && !(glm::distance(before, positions[i]) <= telling[i])) continue;
      mean->moved += alpha * (DVec3(working.cloud().mean.get(row)) - before);
      mean->weight += alpha;
    }
  }
  std::vector<std::size_t> lost;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Mean& mean = near[i].weight > 0 ? near[i] : all[i];
    if (mean.weight == 0)
      lost.push_back(i);
    else if (!request.handles[i].is_anchor())
      positions[i] += mean.moved / mean.weight;
  }
  return lost;
}

}  // namespace engine::edit
