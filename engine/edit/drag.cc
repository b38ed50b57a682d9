#include "engine/edit/drag.h"

#include <optional>

#include "engine/deform/rigid.h"
#include "engine/edit/handles.h"
#include "engine/edit/messages.h"
#include "engine/edit/paste.h"

namespace engine::edit {

Result<deform::Assignment> assign(const Array3& mean, const Request& request) {
  std::vector<deform::Sphere> spheres;
  for (const Handle& handle : request.handles) spheres.push_back({handle.source, handle.radius});
  std::optional<deform::Box> region;
  if (request.region) region = deform::Box{request.region->center, request.region->size};
  return deform::assign(mean, spheres, region);
}

Step plan_step(const WorkingScene& working, const Request& request, std::span<const DVec3> positions, int u,
               int intervals) {
  Step step;
  const auto drags = interval_drags(working, request, positions, u, intervals);
  auto motions = deform::handle_motions(drags, request.params.rotation);
  if (request.params.interpolation == Interpolation::rigid && request.params.rotation == Rotation::shortest_arc)
    deform::turn_whole_groups(drags, motions);
  step.rows = dragged_rows(working);
  step.deformation =
      deform::deformation(working.cloud, step.rows, working.handle, motions, request.params.interpolation);
  for (std::size_t k = 0; k < step.rows.size(); ++k)
    if (step.deformation.moves[k]) step.moving.push_back(step.rows[k]);
  return step;
}

DragResult drag_through(WorkingScene& working, const Request& request, int intervals, bool rotate_sh) {
  DragResult result;
  result.positions = handle_sources(working, request);
  for (int u = 1; u <= intervals; ++u) {
    const Step step = plan_step(working, request, result.positions, u, intervals);
    paste(working, step.deformation, step.rows, request.mode, rotate_sh);
    for (const std::size_t lost : relocate(working, request, result.positions))
      result.warnings.push_back(handle_lost(lost, u));
  }
  for (std::size_t i = 0; i < working.role.size(); ++i)
    if (working.role[i] == Role::copy) result.copies.push_back(std::uint32_t(i));
  return result;
}

}  // namespace engine::edit
