#include "engine/captures/grasp.h"

#include <utility>

#include "engine/captures/looking.h"
#include "engine/core/rows.h"
#include "engine/edit/drag.h"
#include "engine/select/select.h"

namespace engine::captures {
namespace {

// How a careless person places balls, as a share of the radius that one would choose; choices, and part of the
// definition of the cases. The ball's rim runs through about the middle of the thing: half of it is left out, and
// beyond its outline the ball takes in what it should not.
constexpr double too_large = 1.25, off_centre = 1.2;

/// To the right in the first photo.
DVec3 right_of(const CapturedCase& the_case) { return glm::transpose(the_case.cameras.front().rotation)[0]; }

void place_carelessly(const CapturedCase& the_case, edit::Handle& handle) {
  const DVec3 off = off_centre * handle.radius * right_of(the_case);
  handle.source += off;
  if (handle.target) *handle.target += off;
  handle.radius *= too_large;
}

/// A request without what says which Gaussians move.
edit::Request asked_of(const CapturedCase& the_case) {
  edit::Request request;
  request.mode = the_case.mode;
  request.handles = the_case.handles;
  return request;
}

/// The request, and the rows that follow its handles.
Result<Grasp> grasp_of(std::string by, edit::Request request, const scene::GaussianCloud& scene) {
  const auto assigned = edit::assign(scene.mean, request);
  if (!assigned) return propagate(assigned);
  Grasp out{std::move(by), std::move(request), {}};
  out.rows = rows_where(assigned->handle, [&](std::uint16_t handle) {
    return handle > 0 && out.request.handles[handle - 1].target.has_value();
  });
  return out;
}

/// By what grows from clicks; each of its rows goes with the nearest handle.
Result<Grasp> grasp_by_growing(std::string by, select::Grow clicks, const CapturedCase& the_case,
                               const scene::GaussianCloud& scene) {
  edit::Request request = asked_of(the_case);
  select::Selection selection{{select::Op::add, std::move(clicks)}};
  if (the_case.careless) {
    const scene::Camera& photo = the_case.cameras.front();
    const DVec3 handle = request.handles.front().source;
    const double depth = photo.cam_from_world(handle).z;
    selection.push_back({select::Op::add, select::Expand{the_case.careless->beyond_px * depth / photo.fx}});
    selection.push_back({select::Op::intersect, select::Plane{handle, right_of(the_case)}});
  }
  const auto selected = select::select(scene, selection);
  if (!selected) return propagate(selected);
  request.selected = marked_rows(selected->rows);
  if (auto valid = edit::validate(request); !valid) return propagate(valid);
  return grasp_of(std::move(by), std::move(request), scene);
}

}  // namespace

Result<Grasp> grasp_by_balls(const CapturedCase& the_case, const scene::GaussianCloud& scene) {
  edit::Request request = asked_of(the_case);
  request.region = the_case.region;
  if (the_case.careless)
    for (edit::Handle& handle : request.handles) place_carelessly(the_case, handle);
  return grasp_of("balls", std::move(request), scene);
}

Result<Grasp> grasp_by_clicks(const CapturedCase& the_case, const scene::GaussianCloud& scene) {
  return grasp_by_growing("clicks", {the_case.clicks.inside, the_case.clicks.outside, {}}, the_case, scene);
}

Result<Grasp> grasp_by_looking(const CapturedCase& the_case, const scene::GaussianCloud& scene) {
  auto clicks = clicks_of_a_looking_person(the_case, scene);
  if (!clicks) return propagate(clicks);
  return grasp_by_growing("looking", *std::move(clicks), the_case, scene);
}

const std::vector<NamedGrasp>& known_grasps() {
  static const std::vector<NamedGrasp> all{
      {"balls", grasp_by_balls}, {"clicks", grasp_by_clicks}, {"looking", grasp_by_looking}};
  return all;
}

}  // namespace engine::captures
