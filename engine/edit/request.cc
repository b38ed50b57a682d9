#include "engine/edit/request.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>

namespace engine::edit {
namespace {

bool within_limits(DVec3 v) {  // false for NaN
  const DVec3 size = glm::abs(v);
  return size.x <= max_coordinate && size.y <= max_coordinate && size.z <= max_coordinate;
}

Result<void> invalid(std::string message, std::string where) {
  return fail(ErrorCode::invalid_argument, std::move(message), std::move(where));
}

Result<void> validate(const Handle& handle, const std::string& where) {
  const std::string point = "a point has three finite coordinates between -1e12 and 1e12";
  if (!within_limits(handle.source)) return invalid(point, where + ".source");
  if (handle.target && !within_limits(*handle.target)) return invalid(point, where + ".target");
  if (!(handle.radius > 0 && handle.radius <= max_coordinate))
    return invalid("the radius of a handle is a length above 0, in the scene's units", where + ".radius");
  if (handle.group < 0) return invalid("a group is a number from 0 up", where + ".group");
  if (handle.rotation) {
    const double length = glm::length(*handle.rotation);
    if (!(length > 0 && std::isfinite(length)))
      return invalid("a rotation is a quaternion w, x, y, z of finite numbers that are not all 0", where + ".rotation");
  }
  if (handle.scale && !(*handle.scale >= 1 / max_scale && *handle.scale <= max_scale))
    return invalid("a scale is a number from 0.001 to 1000", where + ".scale");
  return {};
}

Result<void> validate(const Region& region) {
  if (!within_limits(region.center))
    return invalid("the centre has three finite coordinates between -1e12 and 1e12", "region.center");
  if (!within_limits(region.size) || !(region.size.x > 0 && region.size.y > 0 && region.size.z > 0))
    return invalid("the three edge lengths of the region are above 0 and at most 1e12", "region.size");
  return {};
}

/// What is removed goes nowhere.
Result<void> validate_removal(const Request& request) {
  for (std::size_t i = 0; i < request.handles.size(); ++i) {
    const Handle& handle = request.handles[i];
    const std::string where = "handles[" + std::to_string(i) + "]";
    const char* const field = handle.target     ? ".target"
                              : handle.rotation ? ".rotation"
                              : handle.scale    ? ".scale"
                                                : nullptr;
    if (field != nullptr)
      return invalid("what is removed goes nowhere: leave this out, or ask for mode \"move\"", where + field);
  }
  return {};
}

/// What only an elastic body does.
Result<void> validate_motion(const Request& request) {
  if (request.params.interpolation == Interpolation::arap) return {};
  const std::string only = std::string(" only with params.interpolation \"arap\", not with \"") +
                           std::string(name_of(request.params.interpolation)) + "\"";
  for (std::size_t i = 0; i < request.handles.size(); ++i) {
    const std::string where = "handles[" + std::to_string(i) + "]";
    if (request.handles[i].rotation) return invalid("a handle turns what it grips" + only, where + ".rotation");
    if (request.handles[i].scale) return invalid("a handle scales what it grips" + only, where + ".scale");
  }
  if (request.attach != Attach::automatic) return invalid("what holds a part can be chosen" + only, "attach");
  return {};
}

/// Crumbs are beside a selection, and a shadow is; both are left behind where a part leaves its place.
///   about  what they are, in words
///   where  the field
template <class Choice>
Result<void> validate_what_goes_along(const Request& request, Choice choice, const char* about, const char* where) {
  if (choice == Choice::move) return {};
  const std::string asked = "\"" + std::string(name_of(choice)) + "\" ";
  if (!request.selected) return invalid(asked + "is about " + about + ": select what moves, or leave this out", where);
  if (request.mode == Mode::extend)
    return invalid(asked + "is about what a part leaves behind; with mode \"extend\" it does not leave", where);
  return {};
}

/// Only what is selected and moved is set down.
Result<void> validate_settle(const Request& request) {
  if (request.settle == Settle::automatic) return {};
  if (!request.selected)
    return invalid("\"off\" is about what is selected: select what moves, or leave this out", "settle");
  if (request.mode != Mode::move || request.params.interpolation != Interpolation::arap)
    return invalid("a part is set down only with mode \"move\" and params.interpolation \"arap\"", "settle");
  return {};
}

Result<void> validate_ascending(std::span<const std::uint32_t> rows, const char* where) {
  if (std::ranges::adjacent_find(rows, std::greater_equal<>()) != rows.end())
    return invalid("selected rows are given once each, in ascending order", where);
  return {};
}

Result<void> validate_selected(std::span<const std::uint32_t> rows) {
  if (rows.empty())
    return fail(ErrorCode::unprocessable,
                "the selection holds no Gaussian, so nothing could be dragged: add to it, or take less away",
                "selection");
  return validate_ascending(rows, "selection");
}

}  // namespace

Result<void> validate(const Request& request) {
  if (const double length = glm::length(request.up); !(length > 0 && std::isfinite(length)))
    return invalid("a direction has three finite numbers that are not all 0", "up");
  if (request.handles.empty()) return invalid("an edit needs at least one handle", "handles");
  if (request.handles.size() > max_handles)
    return invalid("an edit has at most " + std::to_string(max_handles) + " handles, not " +
                       std::to_string(request.handles.size()),
                   "handles");
  for (std::size_t i = 0; i < request.handles.size(); ++i)
    if (auto valid = validate(request.handles[i], "handles[" + std::to_string(i) + "]"); !valid) return valid;
  if (request.selected)
    if (auto valid = validate_selected(*request.selected); !valid) return valid;
  if (request.mode == Mode::remove)
    if (auto valid = validate_removal(request); !valid) return valid;
  if (auto valid = validate_what_goes_along(request, request.crumbs, "what a selection has left out", "crumbs"); !valid)
    return valid;
  if (auto valid = validate_what_goes_along(request, request.shadow, "the shadow of what is selected", "shadow");
      !valid)
    return valid;
  if (auto valid = validate_settle(request); !valid) return valid;
  if (auto valid = validate_ascending(request.healed, "heal"); !valid) return valid;
  if (auto valid = validate_motion(request); !valid) return valid;
  if (request.region)
    if (auto valid = validate(*request.region); !valid) return valid;
  return params::validate(request.params);
}

}  // namespace engine::edit
