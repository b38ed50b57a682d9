#include "engine/edit/working_scene.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "engine/edit/opacity.h"
#include "engine/render/project.h"
#include "engine/scene/cloud_arrays.h"

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

bool same_bits(float a, float b) { return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b); }

bool same_bits(Vec3 a, Vec3 b) { return same_bits(a.x, b.x) && same_bits(a.y, b.y) && same_bits(a.z, b.z); }

/// Row a of one cloud and row b of another are the same bytes.
bool same_row(const scene::GaussianCloud& left, std::size_t a, const scene::GaussianCloud& right, std::size_t b) {
  bool same = true;
  scene::visit_arrays(
      [&](std::size_t stride, const auto& l, const auto& r) {
        const std::size_t bytes = stride * sizeof(l[0]);
        same = same && (bytes == 0 || std::memcmp(l.data() + a * stride, r.data() + b * stride, bytes) == 0);
      },
      left, right);
  return same;
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

std::vector<std::uint32_t> member_rows(const WorkingScene& working) {
  std::vector<std::uint32_t> rows;
  for (std::size_t i = 0; i < working.role.size(); ++i)
    if (working.role[i] != Role::frozen) rows.push_back(std::uint32_t(i));
  return rows;
}

scene::GaussianCloud as_begun(const WorkingScene& working, const scene::GaussianCloud& input,
                              std::span<const std::uint32_t> rows) {
  scene::GaussianCloud out;
  out.sh_degree = input.sh_degree;
  out.extra_stride = input.extra_stride;
  std::vector<std::uint32_t> of_input;
  for (const std::uint32_t row : rows)
    if (row < working.input_rows) of_input.push_back(row);
  scene::append_rows(out, input, of_input);
  if (working.origin != DVec3(0.0))
    for (std::size_t i = 0; i < out.size(); ++i) out.mean.set(i, Vec3(DVec3(out.mean.get(i)) - working.origin));
  return out;
}

void copy_row(const scene::GaussianCloud& from, std::size_t a, scene::GaussianCloud& to, std::size_t b) {
  scene::visit_arrays(
      [&](std::size_t stride, auto& target, const auto& source) {
        std::copy_n(source.begin() + std::ptrdiff_t(a * stride), stride, target.begin() + std::ptrdiff_t(b * stride));
      },
      to, from);
}

scene::Camera in_frame_of(const WorkingScene& working, scene::Camera camera) {
  camera.translation += camera.rotation * working.origin;
  return camera;
}

Published publish(const WorkingScene& working, const scene::GaussianCloud& input, Mode mode) {
  const std::vector<std::uint32_t> members = member_rows(working);
  const scene::GaussianCloud begun = as_begun(working, input, members);
  Published out;
  out.overlay = scene::no_change(input);
  std::vector<std::uint32_t> added;
  std::vector<std::size_t> changed;  // entries of `begun`
  for (std::size_t k = 0; k < members.size(); ++k) {
    const std::uint32_t row = members[k];
    const bool is_input = row < working.input_rows;
    const bool is_changed = !is_input || !same_row(working.cloud, row, begun, k);
    const float logit = working.cloud.opacity_logit[row];
    const bool is_faint = is_changed && render::opacity<double>(logit) < render::min_alpha;
    const bool goes = working.role[row] == Role::original ? logit <= keep_logit(mode) : is_faint;
    if (mode == Mode::move && goes) {
      if (is_input) out.overlay.removed.push_back(row);
      if (working.role[row] != Role::original) ++out.faint;
      continue;
    }
    ++out.changeable;
    if (!is_input)
      added.push_back(row);
    else if (is_changed)
      out.overlay.changed.push_back(row), changed.push_back(k);
  }
  scene::GaussianCloud& rows = out.overlay.rows;
  scene::append_rows(rows, working.cloud, out.overlay.changed);
  scene::append_rows(rows, working.cloud, added);
  if (working.origin != DVec3(0.0))
    for (std::size_t i = 0; i < rows.size(); ++i) rows.mean.set(i, Vec3(DVec3(rows.mean.get(i)) + working.origin));
  for (std::size_t i = 0; i < changed.size(); ++i)
    if (same_bits(working.cloud.mean.get(out.overlay.changed[i]), begun.mean.get(changed[i])))
      rows.mean.set(i, input.mean.get(out.overlay.changed[i]));
  return out;
}

}  // namespace engine::edit
