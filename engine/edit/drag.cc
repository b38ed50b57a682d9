#include "engine/edit/drag.h"

#include <optional>

#include "engine/edit/handles.h"
#include "engine/edit/paste.h"

namespace engine::edit {

Result<deform::Assignment> assign(const scene::GaussianCloud& scene, const Request& request) {
  std::vector<deform::Sphere> spheres;
  for (const Handle& handle : request.handles) spheres.push_back({handle.source, handle.radius});
  std::optional<deform::Box> region;
  if (request.region) region = deform::Box{request.region->center, request.region->size};
  return deform::assign(scene.mean, spheres, region);
}

Step plan_step(const WorkingScene& working, const Request& request, std::span<const DVec3> positions, int u,
               int intervals) {
  Step step;
  const auto drags = interval_drags(working, request, positions, u, intervals);
  const auto motions = deform::handle_motions(drags, request.params.rotation);
  step.rows = dragged_rows(working);
  step.deformation =
      deform::deformation(working.cloud, step.rows, working.handle, motions, request.params.interpolation);
  for (std::size_t k = 0; k < step.rows.size(); ++k)
    if (step.deformation.moves[k]) step.moving.push_back(step.rows[k]);
  return step;
}

std::vector<std::uint32_t> drag_through(WorkingScene& working, const Request& request, int intervals, bool rotate_sh) {
  std::vector<DVec3> positions = handle_sources(working, request);
  for (int u = 1; u <= intervals; ++u) {
    const Step step = plan_step(working, request, positions, u, intervals);
    paste(working, step.deformation, step.rows, request.mode, rotate_sh);
    relocate(working, request, positions);
  }
  std::vector<std::uint32_t> copies;
  for (std::size_t i = 0; i < working.role.size(); ++i)
    if (working.role[i] == Role::copy) copies.push_back(std::uint32_t(i));
  return copies;
}

}  // namespace engine::edit
