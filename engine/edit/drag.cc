#include "engine/edit/drag.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "engine/core/rows.h"
#include "engine/deform/attach.h"
#include "engine/deform/rigid.h"
#include "engine/edit/handles.h"
#include "engine/edit/messages.h"
#include "engine/edit/paste.h"

namespace engine::edit {

namespace {

/// What crumbs there are goes along with the part, or is given up.
void take_crumbs(const scene::LayeredCloud& scene, const Request& request, std::span<const DVec3> centers,
                 const std::optional<deform::Box>& region, Memory& memory, Taken& taken) {
  if (request.crumbs == Crumbs::keep || request.mode == Mode::extend) return;
  const std::vector<std::uint32_t>& crumbs = memory.crumbs_of(scene, *request.selected);
  if (crumbs.empty()) return;
  // Crumbs outside of the region stay, and where it holds none, that is no error.
  const auto assigned = deform::assign_selected(scene::means(scene), crumbs, centers, region);
  if (!assigned) return;
  for (const std::uint32_t row : crumbs) {
    const std::uint16_t handle = assigned->handle[row];
    if (handle == 0) continue;
    ++taken.crumbs;
    if (request.crumbs == Crumbs::remove)
      taken.given_up.push_back(row);
    else
      taken.handle[row] = handle, ++taken.count[handle - 1u];
  }
}

}  // namespace

Result<Taken> assign(const scene::LayeredCloud& scene, const Request& request, Memory& memory) {
  const Array3 mean = scene::means(scene);
  std::vector<deform::Sphere> spheres;
  for (const Handle& handle : request.handles) spheres.push_back({handle.source, handle.radius});
  std::optional<deform::Box> region;
  if (request.region) region = deform::Box{request.region->center, request.region->size};
  const auto beyond = [&](std::uint32_t row, const char* where) {
    return fail(ErrorCode::unprocessable,
                "row " + std::to_string(row) + " is selected; the scene has " + std::to_string(mean.size()), where);
  };
  if (!request.healed.empty() && request.healed.back() >= mean.size()) return beyond(request.healed.back(), "heal");
  const auto taken = [](Result<deform::Assignment> assignment) {
    return std::move(assignment).map([](deform::Assignment&& of) {
      return Taken{std::move(of.handle), std::move(of.count), 0, {}};
    });
  };
  if (!request.selected) return taken(deform::assign(mean, spheres, region));
  if (request.selected->back() >= mean.size()) return beyond(request.selected->back(), "selection");
  std::vector<DVec3> centers;
  for (const Handle& handle : request.handles) centers.push_back(handle.source);
  auto assignment = taken(deform::assign_selected(mean, *request.selected, centers, region));
  if (!assignment) return assignment;
  take_crumbs(scene, request, centers, region, memory, *assignment);
  for (std::size_t h = 0; h < request.handles.size(); ++h)
    if (!request.handles[h].is_anchor() &&
        assignment->count[h] == 0)  // an anchor may hold what is beside the selection
      return fail(ErrorCode::unprocessable,
                  "every selected Gaussian is nearer to another handle than to handle " + std::to_string(h + 1) +
                      ": move this handle or leave it out",
                  "handles[" + std::to_string(h) + "].source");
  return assignment;
}

Result<Taken> assign(const scene::GaussianCloud& scene, const Request& request) {
  const std::shared_ptr<const scene::GaussianCloud> borrowed(std::shared_ptr<const void>(), &scene);
  Memory memory;
  return assign(scene::LayeredCloud{borrowed, nullptr}, request, memory);
}

namespace {

/// Those entries of rows and places where `of` has that value.
void keep(std::span<const std::uint8_t> of, std::uint8_t value, std::vector<std::uint32_t>& rows,
          std::vector<std::size_t>& at) {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < of.size(); ++k)
    if (of[k] == value) rows[kept] = rows[k], at[kept++] = at[k];
  rows.resize(kept), at.resize(kept);
}

/// The rows of one group.
deform::Deformation follow(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                           std::span<const deform::Drag> drags, std::span<const std::uint8_t> held,
                           const deform::Attachment& attachment, Memory& memory) {
  using How = deform::Attachment::How;
  const deform::RigidMotion nearest = deform::nearest_motion(drags, attachment.group, attachment.scales);
  switch (attachment.how) {
    case How::one_piece:
      return deform::deformation(cloud, rows, nearest);
    case How::continued:
      return deform::deformation(cloud, rows, {.shift = nearest.shift});
    case How::drawn_out:
      return memory.body_of(cloud, rows, drags, held).draw_out(cloud, drags, nearest.shift);
    case How::free:
    case How::held:
      break;
  }
  return memory.body_of(cloud, rows, drags, held).follow(cloud, drags);
}

/// Each group of the rows as a body by itself.
deform::Deformation follow_as_bodies(const WorkingScene& working, std::span<const std::uint32_t> rows,
                                     std::span<const deform::Drag> drags, const Parts& parts, Memory& memory) {
  deform::Deformation out = deform::at_rest(working.cloud(), rows);
  for (const deform::Attachment& attachment : parts.attachments) {
    std::vector<deform::Drag> own_drags;
    for (std::size_t i = 0; i < drags.size(); ++i)
      if (drags[i].group == attachment.group && !std::ranges::binary_search(parts.idle, i))
        own_drags.push_back(drags[i]);
    std::vector<std::uint32_t> own_rows;
    std::vector<std::size_t> at;
    std::vector<std::uint8_t> held;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      if (drags[working.handle()[rows[k]] - 1u].group != attachment.group) continue;
      own_rows.push_back(rows[k]), at.push_back(k);
      held.push_back(std::ranges::binary_search(parts.rim, working.parent()[rows[k]]));
    }
    if (own_rows.empty()) continue;
    if (attachment.how == deform::Attachment::How::continued) keep(held, 0, own_rows, at);
    deform::scatter(follow(working.cloud(), own_rows, own_drags, held, attachment, memory), at, out);
  }
  return out;
}

bool is_at_rest(const deform::Drag& drag) {
  return drag.anchor || (drag.source == drag.target && drag.scale == 1 &&
                         (!drag.turn || DVec3(drag.turn->x, drag.turn->y, drag.turn->z) == DVec3(0.0)));
}

deform::Deformation follow_handles(const WorkingScene& working, std::span<const std::uint32_t> rows,
                                   std::span<const deform::Drag> drags, const Request& request, const Parts& parts,
                                   Memory& memory) {
  const Params& params = request.params;
  if (params.interpolation == Interpolation::arap)
    return std::ranges::all_of(drags, is_at_rest) ? deform::at_rest(working.cloud(), rows)
                                                  : follow_as_bodies(working, rows, drags, parts, memory);
  auto motions = deform::handle_motions(drags, params.rotation);
  if (params.interpolation == Interpolation::rigid && params.rotation == Rotation::shortest_arc)
    deform::turn_whole_groups(drags, motions);
  return deform::deformation(working.cloud(), rows, working.handle(), motions, params.interpolation);
}

/// What of a continuation appears in interval u: each row as soon as the part has made room for it.
void go_on(const Continuation& continuation, int u, int intervals, PlannedMotion& motion) {
  const double period = glm::length(continuation.step);
  const double before = continuation.way * double(u - 1) / intervals, now = continuation.way * double(u) / intervals;
  for (std::size_t k = 0; k < continuation.tile.size(); ++k)
    for (int n = 1; n * period - continuation.depth[k] < now; ++n) {
      if (n * period - continuation.depth[k] < before) continue;
      motion.continued.push_back(continuation.tile[k]);
      motion.shift.push_back(double(n) * continuation.step);
    }
}

}  // namespace

PlannedMotion plan_motion(const WorkingScene& working, const Request& request, const Parts& parts,
                          std::span<const DVec3> positions, int u, int intervals, Memory& memory) {
  const auto drags = interval_drags(working.frame(), request, parts.corrected, positions, u, intervals);
  PlannedMotion motion;
  motion.rows = working.dragged_rows();
  if (request.mode == Mode::remove) {
    motion.deformation = deform::at_rest(working.cloud(), motion.rows);
    motion.moving = motion.rows;
    motion.removes = true;
    return motion;
  }
  motion.deformation = follow_handles(working, motion.rows, drags, request, parts, memory);
  for (std::size_t k = 0; k < motion.rows.size(); ++k)
    if (motion.deformation.moves[k]) motion.moving.push_back(motion.rows[k]);
  for (const Continuation& continuation : parts.continuations) go_on(continuation, u, intervals, motion);
  return motion;
}

DraggedAlone drag_alone(std::vector<std::uint32_t> rows, const scene::GaussianCloud& gaussians,
                        std::span<const std::uint16_t> handle, const Request& request, const Parts& parts,
                        int intervals, bool rotate_sh, Memory& memory) {
  working::HandleColumn own_handle;
  for (const std::uint32_t row : rows) own_handle.push_back(handle[row]);
  const working::Frame frame = frame_of(request);
  const Parts own_parts = among(parts, rows);
  DraggedAlone drag{
      std::move(rows), WorkingScene(gaussians, frame, std::move(own_handle)), handle_sources(frame, request), {}};
  for (int u = 1; u <= intervals; ++u) {
    const PlannedMotion motion = plan_motion(drag.working, request, own_parts, drag.positions, u, intervals, memory);
    copy_and_paste(drag.working, motion, departure_of(request), rotate_sh);
    if (motion.removes) continue;  // nothing is left that a handle could be on
    for (const std::size_t lost : relocate(drag.working, request, drag.positions))
      drag.warnings.push_back(handle_lost(lost, u));
  }
  return drag;
}

DraggedAlone drag_alone(const scene::GaussianCloud& scene, std::span<const std::uint16_t> handle,
                        const Request& request, const Parts& parts, int intervals) {
  std::vector<std::uint32_t> rows = rows_in_use(handle, parts);
  const scene::GaussianCloud gaussians = scene::gather(scene, rows);
  Memory memory;
  return drag_alone(std::move(rows), gaussians, handle, request, parts, intervals, /*rotate_sh=*/false, memory);
}

}  // namespace engine::edit
