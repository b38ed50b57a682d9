#include "engine/edit/request.h"

#include <cmath>

#include "engine/deform/intervals.h"

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
  return {};
}

Result<void> validate(const Region& region) {
  if (!within_limits(region.center))
    return invalid("the centre has three finite coordinates between -1e12 and 1e12", "region.center");
  if (!within_limits(region.size) || !(region.size.x > 0 && region.size.y > 0 && region.size.z > 0))
    return invalid("the three edge lengths of the region are above 0 and at most 1e12", "region.size");
  return {};
}

Result<void> validate(const Params& params) {
  const auto outside = [](int value, int low, int high) { return value < low || value > high; };
  const auto range = [](int value, const char* what, const std::string& allowed) {
    return std::string(what) + " is " + allowed + ", not " + std::to_string(value);
  };
  if (outside(params.intervals, 0, deform::max_intervals))
    return invalid(range(params.intervals, "the number of intervals",
                         "1 to " + std::to_string(deform::max_intervals) + ", or 0 to choose it from the drag"),
                   "params.intervals");
  if (outside(params.views, 1, max_views))
    return invalid(range(params.views, "the number of views", "1 to " + std::to_string(max_views)), "params.views");
  if (outside(params.max_image_side, 16, 16384))
    return invalid(range(params.max_image_side, "the longer side of a working picture", "16 to 16384 pixels"),
                   "params.max_image_side");
  if (outside(params.iterations, 0, 1'000'000))
    return invalid(range(params.iterations, "the number of iterations per correction", "0 to 1,000,000"),
                   "params.iterations");
  if (outside(params.annealing_steps, 1, 100))
    return invalid(range(params.annealing_steps, "the number of corrections per interval", "1 to 100"),
                   "params.annealing_steps");
  for (const auto& [strength, where] : {std::pair{params.strength_initial, "params.strength_initial"},
                                        {params.strength_final, "params.strength_final"}})
    if (!(strength >= 0 && strength <= 1)) return invalid("a strength is a number from 0 to 1", where);
  return {};
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
  if (request.region)
    if (auto valid = validate(*request.region); !valid) return valid;
  return validate(request.params);
}

}  // namespace engine::edit
