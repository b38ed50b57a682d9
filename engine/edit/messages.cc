#include "engine/edit/messages.h"

namespace engine::edit {

std::string nothing_moves() { return "nothing moves: every target is where its handle is"; }

std::string no_view_sees_it() { return "no view sees the edited part"; }

std::string no_view_to_exclude(const std::string& name) { return "there is no view \"" + name + "\" to exclude"; }

std::string handle_lost(std::size_t handle, int interval) {
  return "handle " + std::to_string(handle + 1) + " has lost all its Gaussians in interval " +
         std::to_string(interval) + " and stays where it is";
}

std::string anchor_is_idle(std::size_t handle) {
  return "handle " + std::to_string(handle + 1) +
         " is an anchor that holds nothing: nothing that moves is within its radius of it";
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
