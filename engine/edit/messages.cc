#include "engine/edit/messages.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "engine/deform/rigid.h"
#include "engine/edit/handles.h"

namespace engine::edit {
namespace {

/// Part of what is uncovered that may stay open unsaid: rims leave a few pixels everywhere. A choice.
constexpr double worth_saying = 0.1;
/// Of the longest way of its group, by how much a handle may stop short unsaid. A choice.
constexpr double overlooked = 0.1;

std::string anchor_is_idle(std::size_t handle) {
  return "handle " + std::to_string(handle + 1) +
         " is an anchor that holds nothing: nothing that moves is within its radius of it";
}

std::string handle_is_astray(std::size_t handle, double away) {
  std::ostringstream distance;
  distance << away;
  return "handle " + std::to_string(handle + 1) + " lies " + distance.str() +
         " from the nearest Gaussian that it moves, farther than all of them are apart: is it where it should be?";
}

std::string comes_off(const deform::Attachment& part) {
  const std::string which = part.group == 0 ? "the part" : "the part of group " + std::to_string(part.group);
  return which + " comes off what it grows out of, as " + part.why;
}

}  // namespace

std::string nothing_moves() { return "nothing moves: every target is where its handle is"; }

std::string no_view_sees_it() { return "no view sees the edited part"; }

std::string no_view_to_exclude(const std::string& name) { return "there is no view \"" + name + "\" to exclude"; }

std::string handle_lost(std::size_t handle, int interval) {
  return "handle " + std::to_string(handle + 1) + " has lost all its Gaussians in interval " +
         std::to_string(interval) + " and stays where it is";
}

std::vector<std::string> warnings_of(const Parts& parts) {
  std::vector<std::string> warnings;
  for (const std::size_t anchor : parts.idle) warnings.push_back(anchor_is_idle(anchor));
  for (const auto& [handle, away] : parts.astray) warnings.push_back(handle_is_astray(handle, away));
  for (const deform::Attachment& part : parts.attachments)
    if (part.comes_off) warnings.push_back(comes_off(part));
  return warnings;
}

std::vector<std::string> handles_stop_short(const Request& request, const Parts& parts,
                                            std::span<const DVec3> positions) {
  const std::vector<deform::Drag> drags = whole_drags(request);
  std::vector<std::string> warnings;
  for (const deform::Attachment& part : parts.attachments) {
    if (part.how != deform::Attachment::How::held && part.how != deform::Attachment::How::drawn_out) continue;
    const double longest = deform::places_of(drags, part.group).longest;
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const Handle& handle = request.handles[i];
      // What is around a handle that turns or grows goes elsewhere than the handle itself.
      if (handle.group != part.group || !handle.target || handle.rotation || handle.scale) continue;
      if (positions[i] == handle.source) continue;  // it has lost its Gaussians, which is said
      const double left = glm::distance(positions[i], handle.end());
      if (!(left > overlooked * longest)) continue;
      warnings.push_back("handle " + std::to_string(i + 1) + " stops " +
                         std::to_string(std::lround(100 * left / longest)) +
                         " % of the way short of its target, as its part is held");
    }
  }
  return warnings;
}

std::string left_open(std::span<const Uncovered> views) {
  double area = 0, open = 0;
  for (const Uncovered& view : views) area += view.area, open += view.open;
  if (!(open > worth_saying * area)) return {};
  const Uncovered& worst = *std::ranges::max_element(views, {}, &Uncovered::open);
  return std::to_string(std::lround(100 * open / area)) +
         " % of the place that was left could not be completed: no camera has seen what is there, and no surface goes "
         "on there; most of it shows in view \"" +
         worst.view + "\"";
}

std::string outskirts_go(std::size_t backing, std::size_t buried) {
  return "what nobody sees of the part by itself goes: " + std::to_string(backing) +
         " Gaussians of its colour behind it, and " + std::to_string(buried) +
         " of its own that lie in what stays; crumbs \"keep\" keeps them";
}

std::string faint_left_out(std::size_t copies) {
  return std::to_string(copies) + " dragged Gaussians have an opacity below 1/255 and are left out";
}

Error leaves_nothing() {
  return {
      ErrorCode::unprocessable,
      "the edit would leave an empty scene: every Gaussian is dragged, and each has an opacity below 1/255, which a "
      "move removes; choose smaller radii, or mode extend",
      "handles"};
}

}  // namespace engine::edit
