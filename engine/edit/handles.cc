#include "engine/edit/handles.h"

#include <algorithm>

#include "engine/deform/intervals.h"
#include "engine/deform/rigid.h"
#include "engine/render/project.h"

namespace engine::edit {
namespace {

/// Nearer than this many times their own extent, handles are edited in the world's frame, which costs no rounding at
/// all. Beyond, the world's floats are coarser than those of a frame around the handles.
constexpr double far_away = 16;

}  // namespace

int resolved_intervals(const Request& request) {
  if (request.params.intervals > 0) return request.params.intervals;
  // What an extend leaves along its way is as long as the part is: its sphere's diameter. More intervals than close the
  // gap only lay half-transparent layers of it over each other.
  const double step = request.mode == Mode::extend ? 2 : 1;
  std::vector<deform::DragLength> drags;
  for (const Handle& handle : request.handles)
    drags.push_back({glm::distance(handle.target.value_or(handle.source), handle.source), step * handle.radius});
  return deform::default_intervals(drags);
}

bool one_interval_is_exact(const Request& request) {
  const Params& params = request.params;
  if (params.interpolation != Interpolation::rigid || params.rotation != Rotation::shortest_arc) return false;
  std::vector<deform::Drag> drags;
  for (const Handle& handle : request.handles)
    drags.push_back({handle.source, handle.target.value_or(handle.source), handle.group, !handle.target});
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
    for (const DVec3& point : {handle.source, handle.target.value_or(handle.source)})
      low = glm::min(low, point), high = glm::max(high, point);
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

std::vector<deform::Drag> interval_drags(const working::Frame& frame, const Request& request,
                                         std::span<const DVec3> positions, int u, int intervals) {
  std::vector<deform::Drag> drags;
  for (std::size_t i = 0; i < request.handles.size(); ++i) {
    const Handle& handle = request.handles[i];
    deform::Drag drag{positions[i], positions[i], handle.group, !handle.target};
    if (handle.target)
      drag.target = deform::interval_target(frame.edit_from_world(handle.source), frame.edit_from_world(*handle.target),
                                            u, intervals);
    drags.push_back(drag);
  }
  return drags;
}

std::vector<std::size_t> relocate(const working::WorkingScene& working, const Request& request,
                                  std::vector<DVec3>& positions) {
  std::vector<DVec3> moved(positions.size(), DVec3(0.0));  // weighted sums
  std::vector<double> weight(positions.size(), 0.0);
  for (std::size_t row = 0; row < working.size(); ++row) {
    if (working.handle()[row] == 0) continue;
    const std::size_t i = working.handle()[row] - 1u;
    const double alpha = render::opacity<double>(working.cloud().opacity_logit[row]);
    moved[i] += alpha * (DVec3(working.cloud().mean.get(row)) - DVec3(working.mean_at_deform().get(row)));
    weight[i] += alpha;
  }
  std::vector<std::size_t> lost;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (weight[i] == 0)
      lost.push_back(i);
    else if (request.handles[i].target)
      positions[i] += moved[i] / weight[i];
  }
  return lost;
}

}  // namespace engine::edit
