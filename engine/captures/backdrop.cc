#include "engine/captures/backdrop.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/captures/photographs.h"
#include "engine/captures/plan_parts.h"
#include "engine/render/pick.h"
#include "engine/scene/in_picture.h"
#include "engine/scene/sh.h"
#include "engine/working/footprint.h"

namespace engine::captures {
namespace {

// A point shows where a thing covers less of its pixel than this, and is found by so many photos at least.
constexpr float covering = 0.5f;
constexpr int least_photos = 2;
constexpr double least_shift = 0.05;  // of the thing's longest side: less is no edit

/// Corners of the box around all of a plan's things before the edit: a grid of places of each patch says how far it
/// reaches, to a hundredth or so.
struct Extent {
  DVec3 low{std::numeric_limits<double>::infinity()}, high{-std::numeric_limits<double>::infinity()};
};
Extent extent_of(const std::vector<Thing>& things) {
  constexpr int steps = 24;
  Extent out;
  for (const Thing& thing : things)
    for (const procedural::Patch& patch : thing.object.patches)
      for (int i = 0; i <= steps; ++i)
        for (int j = 0; j <= steps; ++j) {
          const Vec3 local = patch.position(float(i) / steps, float(j) / steps);
          DVec3 place(thing.object.placement.world(local));
          if (thing.pose) place = thing.pose(place);
          out.low = glm::min(out.low, place), out.high = glm::max(out.high, place);
        }
  return out;
}

/// The rotation that takes the plan's height (-y) to `up`, and what faces the plan's viewer (-z) as nearly as it can to
/// the camera's: on a floor that is where the camera is, on a wall down.
DMat3 upright(DVec3 up, const scene::Camera& camera) {
  const DMat3 axes = glm::transpose(camera.rotation);  // right, down, away
  DVec3 to_viewer = axes[1] - axes[2];
  to_viewer -= glm::dot(to_viewer, up) * up;
  constexpr double least = 1e-3;  // of a vector of about 1: a surface that is tilted halfway between the two
  if (glm::length(to_viewer) < least) to_viewer = axes[1] - glm::dot(axes[1], up) * up;
  to_viewer = glm::normalize(to_viewer);
  return DMat3(glm::cross(up, to_viewer), -up, -to_viewer);
}

Result<render::PixelHit> surface_at(const Backdrop& backdrop, const scene::Camera& camera, DVec2 place,
                                    const char* where) {
  render::Workspace workspace;
  const auto hit = render::pick(backdrop.scene, camera, {place.x * camera.width, place.y * camera.height}, workspace);
  if (!hit) return fail(ErrorCode::unprocessable, "the photo shows no surface there", where);
  return *hit;
}

/// The scene with these rows in white, or in their colours, and all else black.
scene::GaussianCloud blackened(const scene::GaussianCloud& scene, std::span<const std::uint32_t> rows, bool white) {
  scene::GaussianCloud out = scene;
  const std::size_t coefficients = scene::sh_coefficients(scene.sh_degree);
  std::vector<std::uint8_t> kept(scene.size(), 0);
  for (const std::uint32_t row : rows) kept[row] = 1;
  for (std::size_t row = 0; row < out.size(); ++row) {
    if (kept[row] != 0 && !white) continue;
    const auto sh = out.sh_row(row);
    std::ranges::fill(sh, 0.0f);
    for (std::size_t c = 0; c < 3; ++c) sh[c * coefficients] = (kept[row] != 0 ? 0.5f : -0.5f) / float(scene::sh_c0);
  }
  return out;
}

}  // namespace

Result<const fit::Photo*> photo_named(const Backdrop& backdrop, const std::string& name) {
  const auto found =
      std::ranges::find(backdrop.photos, name, [](const fit::Photo& photo) { return photo.camera.name; });
  if (found != backdrop.photos.end()) return &*found;
  return fail(ErrorCode::not_found,
              "there is no photo \"" + name + "\"; the first is \"" + backdrop.photos.front().camera.name + "\"",
              "view");
}

Result<Standing> stand_in(Plan plan, const Backdrop& backdrop, const Stand& stand) {
  if (plan.mode != edit::Mode::move || plan.drawn_from || !plan.only_after.empty())
    return fail(ErrorCode::unprocessable, "what it moves is drawn out, and cannot be drawn into photos", "case");
  const auto is_finite = [](DVec2 place) { return std::isfinite(place.x) && std::isfinite(place.y); };
  if (!is_finite(stand.at)) return fail(ErrorCode::invalid_argument, "expected two finite numbers", "at");
  if (!is_finite(stand.to)) return fail(ErrorCode::invalid_argument, "expected two finite numbers", "to");
  if (!(stand.size > 0) || !std::isfinite(stand.size))
    return fail(ErrorCode::invalid_argument, "expected a finite number above 0", "size");
  const auto photo = photo_named(backdrop, stand.view);
  if (!photo) return propagate(photo);
  const scene::Camera& camera = (*photo)->camera;
  const auto at = surface_at(backdrop, camera, stand.at, "at");
  if (!at) return propagate(at);
  const auto to = surface_at(backdrop, camera, stand.to, "to");
  if (!to) return propagate(to);

  const auto [low, high] = extent_of(plan.things);
  const DVec3 size = high - low, foot{0.5 * (low.x + high.x), high.y, 0.5 * (low.z + high.z)};
  const double longest = std::max({size.x, size.y, size.z});
  const double scale = stand.size * camera.height * at->depth / camera.fy / longest;
  const DVec3 shift = to->point - at->point;
  if (glm::length(shift) < least_shift * scale * longest)
    return fail(ErrorCode::unprocessable, "the thing is there before the edit", "to");
  const DMat3 turn = upright(at->normal, camera);
  const Motion into = [=, there = at->point](DVec3 point) { return there + scale * (turn * (point - foot)); };

  for (Thing& thing : plan.things) {
    thing.pose = thing.pose ? Motion([into, pose = thing.pose](DVec3 point) { return into(pose(point)); }) : into;
    thing.motion = shifted(shift);
  }
  for (Grip& grip : plan.grips) grip.near = into(grip.near), grip.radius *= scale;
  std::erase_if(plan.grips, [](const Grip& grip) { return grip.anchor; });
  for (auto* places : {&plan.clicks.inside, &plan.clicks.outside})
    for (DVec3& place : *places) place = into(place);
  plan.what = "The thing of a case, drawn into photos of " + backdrop.name + " and slid along what it stands on.";
  plan.said.clear(), plan.glossy.clear(), plan.surroundings.clear();
  plan.region.reset(), plan.careless.reset(), plan.casts_shadows = false;
  return Standing{std::move(plan), scale};
}

scene::Image drawn_into(const fit::Photo& photo, const scene::GaussianCloud& scene,
                        std::span<const std::uint32_t> rows) {
  scene::Image out;
  fit::to_image(photo, out);
  const scene::Image light = photograph(blackened(scene, rows, false), photo.camera);
  const scene::Image share = photograph(blackened(scene, rows, true), photo.camera);
  for (std::size_t i = 0; i < out.data.size(); ++i)
    out.data[i] = std::min(out.data[i] * (1 - share.data[i]) + light.data[i], 1.0f);
  return out;
}

std::vector<fit::ColoredPoint> points_beside(const Backdrop& backdrop, std::span<const scene::Camera> cameras,
                                             const scene::GaussianCloud& scene, std::span<const std::uint32_t> rows) {
  std::vector<int> photos(backdrop.points.size(), 0);
  render::Workspace workspace;
  for (const scene::Camera& camera : cameras) {
    const scene::Image share = working::footprint(scene, rows, camera, workspace);
    for (std::size_t i = 0; i < photos.size(); ++i) {
      const auto pixel = scene::pixel_in_picture(camera, camera.cam_from_world(backdrop.points[i].position));
      if (pixel) photos[i] += share.at(int(pixel->x), int(pixel->y)) < covering;
    }
  }
  std::vector<fit::ColoredPoint> out;
  for (std::size_t i = 0; i < photos.size(); ++i)
    if (photos[i] >= least_photos) out.push_back(backdrop.points[i]);
  return out;
}

}  // namespace engine::captures
