#include "engine/edit/drag.h"

#include <optional>
#include <string>
#include <utility>

#include "engine/core/rows.h"
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
  if (!request.selected) return deform::assign(mean, spheres, region);
  if (request.selected->back() >= mean.size())
    return fail(ErrorCode::unprocessable,
                "row " + std::to_string(request.selected->back()) + " is selected; the scene has " +
                    std::to_string(mean.size()),
                "selection");
  std::vector<DVec3> centers;
  for (const Handle& handle : request.handles) centers.push_back(handle.source);
  auto assignment = deform::assign_selected(mean, *request.selected, centers, region);
  for (std::size_t h = 0; assignment && h < request.handles.size(); ++h)
    if (request.handles[h].target && assignment->count[h] == 0)  // an anchor may hold what is beside the selection
      return fail(ErrorCode::unprocessable,
                  "every selected Gaussian is nearer to another handle than to handle " + std::to_string(h + 1) +
                      ": move this handle or leave it out",
                  "handles[" + std::to_string(h) + "].source");
  return assignment;
}

PlannedMotion plan_motion(const WorkingScene& working, const Request& request, std::span<const DVec3> positions, int u,
                          int intervals) {
  const auto drags = interval_drags(working.frame(), request, positions, u, intervals);
  auto motions = deform::handle_motions(drags, request.params.rotation);
  if (request.params.interpolation == Interpolation::rigid && request.params.rotation == Rotation::shortest_arc)
    deform::turn_whole_groups(drags, motions);
  PlannedMotion motion;
  motion.rows = working.dragged_rows();
  motion.deformation =
      deform::deformation(working.cloud(), motion.rows, working.handle(), motions, request.params.interpolation);
  for (std::size_t k = 0; k < motion.rows.size(); ++k)
    if (motion.deformation.moves[k]) motion.moving.push_back(motion.rows[k]);
  return motion;
}

std::vector<std::uint32_t> dragged_rows(std::span<const std::uint16_t> handle) {
  return rows_where(handle, [](std::uint16_t number) { return number != 0; });
}

DraggedAlone drag_alone(std::vector<std::uint32_t> rows, const scene::GaussianCloud& gaussians,
                        std::span<const std::uint16_t> handle, const Request& request, int intervals, bool rotate_sh) {
  working::HandleColumn own_handle;
  for (const std::uint32_t row : rows) own_handle.push_back(handle[row]);
  const working::Frame frame = frame_of(request);
  DraggedAlone drag{
      std::move(rows), WorkingScene(gaussians, frame, std::move(own_handle)), handle_sources(frame, request), {}};
  for (int u = 1; u <= intervals; ++u) {
    const PlannedMotion motion = plan_motion(drag.working, request, drag.positions, u, intervals);
    copy_and_paste(drag.working, motion, request.mode, rotate_sh);
    for (const std::size_t lost : relocate(drag.working, request, drag.positions))
      drag.warnings.push_back(handle_lost(lost, u));
  }
  return drag;
}

}  // namespace engine::edit
