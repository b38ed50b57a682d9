#include "engine/edit/working_scene.h"

#include <algorithm>
#include <cmath>

#include "engine/edit/opacity.h"
#include "engine/render/project.h"

namespace engine::edit {
namespace {

/// Nearer than this many times their own extent, handles are edited in the world's frame, which costs no rounding at
/// all. Beyond, the world's floats are coarser than those of a frame around the handles.
constexpr double far_away = 16;

DVec3 choose_origin(const Request& request) {
  DVec3 low(request.handles.front().source), high(low);
  double reach = 0;
  for (const Handle& handle : request.handles) {
    for (const DVec3& point : {handle.source, handle.target.value_or(handle.source)})
      low = glm::min(low, point), high = glm::max(high, point);
    reach = std::max(reach, handle.radius);
  }
  const DVec3 middle = (low + high) / 2.0;
  if (glm::length(middle) <= far_away * (glm::distance(low, high) + reach)) return DVec3(0.0);
  return DVec3(Vec3(middle));
}

void assign_roles(WorkingScene& working, const deform::HandleColumn& handle) {
  working.handle = handle;
  working.role.resize(handle.size());
  std::transform(handle.begin(), handle.end(), working.role.begin(),
                 [](std::uint16_t owner) { return owner == 0 ? Role::frozen : Role::held; });
}

}  // namespace

WorkingScene begin(const scene::GaussianCloud& input, const Request& request, const deform::HandleColumn& handle) {
  WorkingScene working;
  working.origin = choose_origin(request);
  working.input_rows = input.size();
  working.cloud = input;
  if (working.origin != DVec3(0.0))
    for (std::size_t i = 0; i < input.size(); ++i)
      working.cloud.mean.set(i, Vec3(DVec3(input.mean.get(i)) - working.origin));
  assign_roles(working, handle);
  working.parent.resize(input.size());
  for (std::size_t i = 0; i < input.size(); ++i) working.parent[i] = std::uint32_t(i);
  working.mean_at_deform = working.cloud.mean;
  return working;
}

void rewind(WorkingScene& working, const scene::GaussianCloud& input, const deform::HandleColumn& handle) {
  working.cloud.resize(working.input_rows);
  working.cloud.opacity_logit = input.opacity_logit;
  working.parent.resize(working.input_rows);
  working.mean_at_deform.resize(working.input_rows);
  assign_roles(working, handle);
}

std::vector<std::uint32_t> dragged_rows(const WorkingScene& working) {
  std::vector<std::uint32_t> rows;
  for (std::size_t i = 0; i < working.handle.size(); ++i)
    if (working.handle[i] != 0) rows.push_back(std::uint32_t(i));
  return rows;
}

scene::Camera in_frame_of(const WorkingScene& working, scene::Camera camera) {
  camera.translation += camera.rotation * working.origin;
  return camera;
}

Published publish(const WorkingScene& working, const scene::GaussianCloud& input, Mode mode) {
  std::vector<std::uint8_t> keep(working.role.size(), 1);
  if (mode == Mode::move)
    for (std::size_t i = 0; i < keep.size(); ++i) {
      const float logit = working.cloud.opacity_logit[i];
      if (working.role[i] == Role::original) keep[i] = logit > keep_logit(mode);
      if (working.role[i] == Role::copy) keep[i] = render::opacity<double>(logit) >= render::min_alpha;
    }

  Published out;
  for (std::size_t i = 0; i < keep.size(); ++i) out.faint += working.role[i] == Role::copy && !keep[i];
  out.cloud = scene::select(input, std::span(keep).first(working.input_rows));
  out.survivors = out.cloud.size();
  std::vector<std::uint32_t> copies;
  for (std::size_t i = 0; i < keep.size(); ++i) {
    if (!keep[i]) continue;
    if (i >= working.input_rows) copies.push_back(std::uint32_t(i));
    if (working.role[i] == Role::original) out.cloud.opacity_logit[out.parent.size()] = working.cloud.opacity_logit[i];
    if (working.role[i] != Role::frozen) ++out.changeable;
    out.parent.push_back(working.parent[i]);
  }
  scene::append_rows(out.cloud, working.cloud, copies);
  if (working.origin != DVec3(0.0))
    for (std::size_t i = out.survivors; i < out.cloud.size(); ++i)
      out.cloud.mean.set(i, Vec3(DVec3(out.cloud.mean.get(i)) + working.origin));
  return out;
}

}  // namespace engine::edit
