#include "engine/edit/parts.h"

#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "engine/core/rows.h"
#include "engine/deform/attach.h"
#include "engine/edit/handles.h"
#include "engine/edit/settle.h"
#include "engine/select/contact.h"
#include "engine/select/footing.h"
#include "engine/select/repeat.h"

namespace engine::edit {
namespace {

using How = deform::Attachment::How;

/// Of the box around the means, but for a hundredth at either end: crumbs that a trainer left far off are selected with
/// what they look like, and made a mug five times its size.
double longest_edge(const Array3& means, std::span<const std::uint32_t> rows) {
  constexpr double astray = 0.01;
  const auto left_out = std::ptrdiff_t(astray * double(rows.size()));
  std::vector<float> along(rows.size());
  double longest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t k = 0; k < rows.size(); ++k) along[k] = means.get(rows[k])[axis];
    const auto end = [&](std::ptrdiff_t rank) {
      std::nth_element(along.begin(), along.begin() + rank, along.end());
      return double(along[std::size_t(rank)]);
    };
    longest = std::max(longest, end(std::ptrdiff_t(rows.size()) - 1 - left_out) - end(left_out));
  }
  return longest;
}

/// From a point to the nearest of the rows.
double distance_to(const Array3& means, std::span<const std::uint32_t> rows, DVec3 point) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const std::uint32_t row : rows) nearest = std::min(nearest, glm::distance(DVec3(means.get(row)), point));
  return nearest;
}

/// Where a part is held: where it grows out of what stays, or, if nowhere, where it stands. What it merely lies against
/// may come apart. Anchors say which of it is meant: of an arm whose shoulder is anchored not the helmet that it holds
/// against a leg.
///   length  longest_edge() of the rows
void hold(const Array3& means, std::span<const std::uint32_t> rows, double length,
          std::span<const select::Touch> touches, std::span<const deform::Drag> drags, deform::Attachment& attachment,
          Parts& parts) {
  constexpr double near_anchor = 0.5;  // of the length
  const double near = near_anchor * length;
  const bool has_anchors = std::ranges::any_of(drags, &deform::Drag::anchor);
  const auto is_meant = [&](std::uint32_t row) {
    return !has_anchors || std::ranges::any_of(drags, [&](const deform::Drag& drag) {
      return drag.anchor && glm::distance(DVec3(means.get(row)), drag.source) <= near;
    });
  };
  const select::Touch holds = attachment.grows_out ? select::Touch::goes_on : select::Touch::stands;
  const std::size_t before = parts.rim.size();
  for (std::size_t k = 0; k < rows.size(); ++k)
    if (touches[k] >= holds && touches[k] != select::Touch::nothing && is_meant(rows[k])) parts.rim.push_back(rows[k]);
  if (parts.rim.size() == before)
    attachment.how = How::free, attachment.why = "its anchors hold it, where nothing else does";
}

/// Of a part that is drawn out and held, and that all its handles take one way: what it grows out of goes on behind it,
/// if that repeats on this way; else it is stretched.
void draw_out(const scene::LayeredCloud& scene, std::span<const std::uint32_t> rows,
              std::span<const select::Touch> touches, std::span<const deform::Drag> drags, Attach asked,
              deform::Attachment& attachment, Parts& parts) {
  const std::optional<DVec3> pull = deform::pull_of(drags, attachment.group);
  if (attachment.how != How::held || !pull) return;
  attachment.how = How::drawn_out;
  if (asked != Attach::automatic) return;
  double limit = std::numeric_limits<double>::infinity();  // handles go with the part
  for (const deform::Drag& drag : drags) limit = std::min(limit, glm::dot(drag.source, glm::normalize(*pull)));
  auto repeat = select::find_repeat(scene, rows, touches, *pull, limit);
  constexpr double most_pieces = 100;  // each has its Gaussians: what goes on and on is better stretched
  const double way = glm::length(*pull);
  if (!repeat || way > most_pieces * glm::length(repeat->step)) return;
  attachment.how = How::continued;
  attachment.why = "what it grows out of repeats along the way, and goes on";
  parts.rim.insert(parts.rim.end(), repeat->stays.begin(), repeat->stays.end());
  parts.continuations.push_back(
      {attachment.group, way, repeat->step, std::move(repeat->tile), std::move(repeat->depth)});
}

/// Is what is selected set down, where it stands on something?
bool settles(const Request& request) {
  return request.settle == Settle::automatic && request.selected && request.mode == Mode::move;
}

/// Of a part that goes as one piece: where its handles go, so that it arrives standing as it stands.
///   own  handles of the part
void set_down(const scene::LayeredCloud& scene, const Array3& means, const select::Stance& stance,
              std::span<const std::size_t> own, std::span<const deform::Drag> drags, deform::Attachment& attachment,
              Parts& parts) {
  std::vector<deform::Drag> asked;
  for (const std::size_t handle : own) asked.push_back(drags[handle]);
  const auto targets = settled(asked, attachment.scales,
                               [&](const deform::RigidMotion& motion) { return stance.after(scene, means, motion); });
  if (!targets) return;
  for (std::size_t k = 0; k < own.size(); ++k) {
    parts.corrected.push_back({own[k], (*targets)[k]});
    attachment.settled = std::max(attachment.settled, glm::distance((*targets)[k], asked[k].target));
  }
}

}  // namespace

Parts parts_of(const scene::LayeredCloud& scene, std::span<const std::uint16_t> handle, const Request& request,
               Memory& memory) {
  Parts parts;
  if (request.params.interpolation != Interpolation::arap || request.mode == Mode::remove) return parts;
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
    const double length = longest_edge(means, rows);
    std::vector<deform::Drag> own;
    std::vector<std::size_t> handles;
    for (std::size_t i = 0; i < drags.size(); ++i) {
      if (drags[i].group != group) continue;
      const double away = distance_to(means, rows, drags[i].source);
      if (drags[i].anchor && away > drags[i].grip) {
        parts.idle.push_back(i);
        continue;
      }
      own.push_back(drags[i]), handles.push_back(i);
      if (!drags[i].anchor && away > length) parts.astray.push_back({i, away});
    }
    if (own.empty()) continue;  // anchors alone, and none of them near: nothing moves
    const select::Contact& contact = memory.contact_of(scene, rows, dragged);
    const auto count = [&](select::Touch touch) { return std::size_t(std::ranges::count(contact.touches, touch)); };
    const std::size_t goes_on = count(select::Touch::goes_on);
    deform::Attachment attachment = deform::attach(drags, group,
                                                   {.shown = contact.shown,
                                                    .touches = goes_on + count(select::Touch::stands),
                                                    .goes_on = goes_on,
                                                    .firmness = contact.firmness,
                                                    .size = length},
                                                   request.attach, request.mode == Mode::extend);
    if (request.mode == Mode::extend) draw_out(scene, rows, contact.touches, own, request.attach, attachment, parts);
    if (attachment.how == How::held || attachment.how == How::drawn_out)
      hold(means, rows, length, contact.touches, own, attachment, parts);
    if (attachment.how == How::one_piece && settles(request))
      set_down(scene, means, memory.stance_of(scene, means, rows, contact.touches, dragged), handles, drags, attachment,
               parts);
    parts.attachments.push_back(std::move(attachment));
  }
  std::sort(parts.rim.begin(), parts.rim.end());
  std::sort(parts.idle.begin(), parts.idle.end());
  std::ranges::sort(parts.astray, {}, &Parts::Astray::handle);
  return parts;
}

Parts parts_of(const scene::GaussianCloud& scene, std::span<const std::uint16_t> handle, const Request& request) {
  const std::shared_ptr<const scene::GaussianCloud> borrowed(std::shared_ptr<const void>(), &scene);
  Memory memory;
  return parts_of(scene::LayeredCloud{borrowed, nullptr}, handle, request, memory);
}

std::vector<std::uint32_t> rows_in_use(std::span<const std::uint16_t> handle, const Parts& parts) {
  std::vector<std::uint32_t> rows = rows_where(handle, [](std::uint16_t number) { return number != 0; });
  for (const Continuation& continuation : parts.continuations)
    rows.insert(rows.end(), continuation.tile.begin(), continuation.tile.end());
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  return rows;
}

Parts among(const Parts& parts, std::span<const std::uint32_t> rows) {
  Parts out = parts;
  const auto renumber = [&](std::vector<std::uint32_t>& of) {
    for (std::uint32_t& row : of) row = std::uint32_t(std::ranges::lower_bound(rows, row) - rows.begin());
  };
  renumber(out.rim);
  for (Continuation& continuation : out.continuations) renumber(continuation.tile);
  return out;
}

}  // namespace engine::edit
