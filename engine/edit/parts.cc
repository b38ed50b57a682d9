#include "engine/edit/parts.h"

#include <algorithm>
#include <map>
#include <memory>
#include <utility>

#include "engine/edit/handles.h"
#include "engine/select/contact.h"

namespace engine::edit {
namespace {

/// Of the box around the means.
double longest_edge(const Array3& means, std::span<const std::uint32_t> rows) {
  DVec3 low(means.get(rows[0])), high(low);
  for (const std::uint32_t row : rows)
    low = glm::min(low, DVec3(means.get(row))), high = glm::max(high, DVec3(means.get(row)));
  const DVec3 size = high - low;
  return std::max({size.x, size.y, size.z});
}

/// Is nothing of the rows within the grip of the drag?
bool grips_nothing(const Array3& means, std::span<const std::uint32_t> rows, const deform::Drag& drag) {
  return std::ranges::none_of(
      rows, [&](std::uint32_t row) { return glm::distance(DVec3(means.get(row)), drag.source) <= drag.grip; });
}

}  // namespace

Parts parts_of(const scene::LayeredCloud& scene, std::span<const std::uint16_t> handle, const Request& request) {
  Parts parts;
  if (request.params.interpolation != Interpolation::arap) return parts;
  std::vector<std::uint32_t> dragged;
  std::map<int, std::vector<std::uint32_t>> rows_of_group;
  for (std::uint32_t row = 0; row < handle.size(); ++row) {
    if (handle[row] == 0) continue;
    dragged.push_back(row);
    rows_of_group[request.handles[handle[row] - 1u].group].push_back(row);
  }
  const std::vector<deform::Drag> drags = whole_drags(request);
  const Array3 means = scene::means(scene);
  for (const auto& [group, rows] : rows_of_group) {
    std::vector<deform::Drag> own;
    for (std::size_t i = 0; i < drags.size(); ++i) {
      if (drags[i].group != group) continue;
      if (drags[i].anchor && grips_nothing(means, rows, drags[i]))
        parts.idle.push_back(i);
      else
        own.push_back(drags[i]);
    }
    if (own.empty()) continue;  // anchors alone, and none of them near: nothing moves
    const std::vector<select::Touch> touches = select::contact_of(scene, rows, dragged);
    const auto count = [&](select::Touch touch) { return std::size_t(std::ranges::count(touches, touch)); };
    const std::size_t grows_out = count(select::Touch::grows_out);
    deform::Attachment attachment = deform::attach(
        drags, group, {grows_out + count(select::Touch::stands), grows_out, longest_edge(means, rows)}, request.attach);
    // Where it grows out of what stays, or, if nowhere, where it stands. What it merely lies against may come apart.
    const select::Touch holds = attachment.grows_out ? select::Touch::grows_out : select::Touch::stands;
    if (attachment.how == deform::Attachment::How::held)
      for (std::size_t k = 0; k < rows.size(); ++k)
        if (touches[k] >= holds && touches[k] != select::Touch::nothing) parts.rim.push_back(rows[k]);
    parts.attachments.push_back(std::move(attachment));
  }
  std::sort(parts.rim.begin(), parts.rim.end());
  std::sort(parts.idle.begin(), parts.idle.end());
  return parts;
}

Parts parts_of(const scene::GaussianCloud& scene, std::span<const std::uint16_t> handle, const Request& request) {
  const std::shared_ptr<const scene::GaussianCloud> borrowed(std::shared_ptr<const void>(), &scene);
  return parts_of(scene::LayeredCloud{borrowed, nullptr}, handle, request);
}

Parts among(const Parts& parts, std::span<const std::uint32_t> rows) {
  Parts out{parts.attachments, {}, parts.idle};
  for (std::uint32_t k = 0; k < rows.size(); ++k)
    if (std::ranges::binary_search(parts.rim, rows[k])) out.rim.push_back(k);
  return out;
}

}  // namespace engine::edit
