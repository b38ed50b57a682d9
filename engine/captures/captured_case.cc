#include "engine/captures/captured_case.h"

#include <algorithm>
#include <cassert>
#include <numbers>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include "engine/core/rng.h"
#include "engine/core/rows.h"
#include "engine/evaluate/named_cases.h"
#include "engine/evaluate/studio.h"
#include "engine/fit/start.h"
#include "engine/procedural/surfels.h"
#include "engine/render/largest_weight.h"
#include "engine/render/pick.h"

namespace engine::captures {
namespace {

// These figures are choices, and part of the definition of the cases: whoever changes one cannot compare results with
// docs/captures.md any more.
constexpr std::uint64_t seed = 11;  // of all that is random in a case, but for what differs between takes
constexpr float spacing = 0.018f;   // between Gaussians of a true surface, world units: a pixel or so of a photo
// What moves less than this counts as standing still: less than a pixel of a photo. World units.
constexpr double least_motion = 0.01;
// What a person points at is the source; the target is where it should go but for an error, whose length has this root
// mean square as a share of the way.
constexpr double handle_noise = 0.02;
constexpr double click_noise_px = 2;  // standard deviation of each coordinate of a click, pixels of a photo
constexpr float gleam = 0.30f;        // of glossy things, see add_gloss()
// A row that photos blend with this weight or more is shown by them.
constexpr float shown_weight = 0.02f;

// Of cases that are drawn into photos.
constexpr std::size_t hold_out = 8;
constexpr std::size_t points_on_thing = 400;  // at most; some are lost to noise, as those of a capture are

constexpr const char* kind = "captured case";  // as errors call it

// Purposes of derived_seed().
constexpr std::uint32_t for_cameras = 21, for_photos = 22, for_points = 23, for_handles = 24, for_clicks = 25;

/// The first take has the stream that was there before there were others.
std::uint64_t seed_for(std::uint32_t take, std::uint32_t purpose, std::uint32_t number = 0) {
  return derived_seed(seed, {purpose, number, take - first_take, 0});
}

std::vector<std::uint32_t> range(std::size_t first, std::size_t last) {
  std::vector<std::uint32_t> rows(last - first);
  std::iota(rows.begin(), rows.end(), std::uint32_t(first));
  return rows;
}

/// Objects without the gloss of their materials, which is made for cameras; gloss comes with add_gloss().
std::vector<procedural::Object> matt(std::vector<procedural::Object> objects) {
  for (procedural::Object& object : objects)
    for (procedural::Patch& patch : object.patches)
      patch.material = [material = std::move(patch.material)](const procedural::SurfacePoint& point) {
        return procedural::Finish{material(point).albedo, 0};
      };
  return objects;
}

/// Objects covered with Gaussians, with room for SH of degree 3.
struct Covered {
  scene::GaussianCloud cloud;
  std::vector<std::uint16_t> object;  ///< [N]
};

///   shading  as for cover_all()
Covered cover(const std::vector<procedural::Object>& objects, std::span<const scene::Camera> cameras,
              std::uint64_t own_seed, std::span<const procedural::Object> shading = {}) {
  procedural::Surfels surfels =
      procedural::cover_all(matt(objects), evaluate::studio_light(), cameras, spacing, own_seed, shading);
  return {fit::with_sh_degree(surfels.cloud, scene::max_sh_degree), std::move(surfels.object)};
}

void gloss_over(const std::vector<std::string>& glossy, const std::vector<procedural::Object>& objects,
                std::span<const std::uint16_t> object_of_row, std::size_t first_row, scene::GaussianCloud& cloud) {
  const Vec3 to_light = evaluate::studio_light().to_sun;
  for (std::size_t i = 0; i < object_of_row.size(); ++i)
    if (std::find(glossy.begin(), glossy.end(), objects[object_of_row[i]].name) != glossy.end())
      add_gloss(to_light, gleam, first_row + i, cloud);
}

/// A thing where a motion takes it.
procedural::Object carried(procedural::Object object, const Motion& motion) {
  for (procedural::Patch& patch : object.patches)
    patch.position = [motion, placement = object.placement, place = std::move(patch.position)](float u, float v) {
      return Vec3(motion(DVec3(placement.world(place(u, v)))));
    };
  object.placement = {};
  return object;
}

/// All that casts shadows on one side of the edit.
std::vector<procedural::Object> all_objects(const Plan& plan, Side side) {
  std::vector<procedural::Object> objects = plan.surroundings;
  for (const Thing& thing : plan.things)
    objects.push_back(carried(thing.object, [&, side](DVec3 point) {
      if (thing.pose) point = thing.pose(point);
      return side == Side::before ? point : thing.motion(point);
    }));
  return objects;
}

/// Appends the things as they are before the edit, and after it, with all gloss.
///   unit  of the plan, world units
void put_things(const Plan& plan, double unit, CapturedCase& out) {
  std::vector<procedural::Object> objects;
  objects.reserve(plan.things.size());
  for (const Thing& thing : plan.things) objects.push_back(thing.object);
  Covered things = cover(objects, out.cameras, seed + 1);
  for (std::size_t i = 0; i < things.cloud.size(); ++i)
    if (const Motion& pose = plan.things[things.object[i]].pose) carry_along(pose, i, things.cloud);
  const std::size_t first = out.before.size(), count = things.cloud.size();
  scene::append_rows(out.before, things.cloud, range(0, count));
  scene::append_rows(out.after, things.cloud, range(0, count));
  for (std::size_t i = 0; i < count; ++i) {
    carry_along(plan.things[things.object[i]].motion, first + i, out.after);
    const auto row = std::uint32_t(first + i);
    if (glm::distance(DVec3(out.before.mean.get(row)), DVec3(out.after.mean.get(row))) < least_motion * unit) continue;
    out.part_before.push_back(row);
    out.part_after.push_back(row);
  }
  gloss_over(plan.glossy, objects, things.object, first, out.before);
  gloss_over(plan.glossy, objects, things.object, first, out.after);
}

/// What moves, and what photos show of it, once all is put.
///   meant  rows of the surroundings that a person means as well
///   unit   of the plan, world units
void note_what_moves(std::vector<std::uint32_t> meant, double unit, CapturedCase& out) {
  meant.insert(meant.end(), out.part_before.begin(), out.part_before.end());  // all of the things come after those
  out.moving = MovingPart(out.before, meant, belongs_within * unit);
  out.shown =
      rows_where(render::largest_weights(out.before, out.cameras), [](float weight) { return weight >= shown_weight; });
}

/// Both scenes and what moves in them.
void put_scenes(const Plan& plan, CapturedCase& out) {
  const auto surroundings = [&](Side side) {
    const auto shading = plan.casts_shadows ? all_objects(plan, side) : std::vector<procedural::Object>();
    Covered around = cover(plan.surroundings, out.cameras, seed, shading);
    gloss_over(plan.glossy, plan.surroundings, around.object, 0, around.cloud);
    return std::move(around.cloud);
  };
  out.before = surroundings(Side::before);
  out.after = plan.casts_shadows ? surroundings(Side::after) : out.before;
  std::vector<std::uint32_t> meant;
  for (std::uint32_t i = 0; plan.drawn_from && i < out.before.size(); ++i)
    if (plan.drawn_from(DVec3(out.before.mean.get(i)))) meant.push_back(i);
  put_things(plan, 1, out);
  if (!plan.only_after.empty()) {
    const Covered grown = cover(plan.only_after, out.cameras, seed + 2);
    const std::size_t first = out.after.size();
    scene::append_rows(out.after, grown.cloud, range(0, grown.cloud.size()));
    gloss_over(plan.glossy, plan.only_after, grown.object, first, out.after);
    for (std::size_t i = 0; i < grown.cloud.size(); ++i) out.part_after.push_back(std::uint32_t(first + i));
  }
  note_what_moves(std::move(meant), 1, out);
}

/// The surface that a person sees near a place and points at, from where the first photo was taken.
class Pointing {
 public:
  explicit Pointing(const CapturedCase& the_case) : case_(the_case) {}
  /// Where nothing is to be seen, the place itself.
  ///   noise_px  standard deviation of each coordinate
  DVec3 operator()(DVec3 place, double noise_px, Rng& rng) {
    const scene::Camera& camera = case_.cameras.front();
    DVec2 pixel = camera.pixel_from_cam(camera.cam_from_world(place));
    for (int axis = 0; axis < 2; ++axis) pixel[axis] += noise_px * double(rng.normal());
    const auto hit = render::pick(case_.before, camera, pixel, workspace_);
    return hit ? hit->point : place;
  }

 private:
  const CapturedCase& case_;
  render::Workspace workspace_;
};

/// A vector of that length, root mean square.
DVec3 noise(double length, Rng& rng) {
  DVec3 out(0.0);
  for (int axis = 0; axis < 3; ++axis) out[axis] = length / std::numbers::sqrt3 * double(rng.normal());
  return out;
}

void place_handles(const Plan& plan, CapturedCase& out) {
  Pointing point_at(out);
  for (std::size_t h = 0; h < plan.grips.size(); ++h) {
    const Grip& grip = plan.grips[h];
    Rng rng(seed_for(out.take, for_handles), h);
    edit::Handle handle{
        .source = point_at(grip.near, 0, rng), .target = std::nullopt, .radius = grip.radius, .group = 0};
    if (!grip.anchor) {
      const DVec3 target = plan.things[grip.thing].motion(handle.source);
      handle.target = target + noise(handle_noise * glm::distance(handle.source, target), rng);
    }
    out.handles.push_back(handle);
  }
}

void place_clicks(const ClickPlan& plan, CapturedCase& out) {
  Pointing point_at(out);
  std::uint64_t number = 0;
  const auto click = [&](DVec3 near) {
    Rng rng(seed_for(out.take, for_clicks), number++);
    return point_at(near, click_noise_px, rng);
  };
  for (const DVec3& near : plan.inside) out.clicks.inside.push_back(click(near));
  for (const DVec3& near : plan.outside) out.clicks.outside.push_back(click(near));
}

/// What a person would ask for, once the scenes are there.
void put_wish(const Plan& plan, CapturedCase& out) {
  out.what = plan.what, out.said = plan.said, out.textured = plan.textured;
  out.mode = plan.mode, out.region = plan.region, out.careless = plan.careless;
  place_handles(plan, out);
  place_clicks(plan.clicks, out);
}

CapturedCase carry_out(const std::string& name, std::uint32_t take, const Plan& plan) {
  CapturedCase out;
  out.name = name, out.take = take;
  out.is_test = plan.is_test || take != first_take;
  out.cameras = photo_cameras(plan.orbit, seed_for(take, for_cameras));
  HeldOut held_out = held_out_cameras(plan.orbit, seed_for(take, for_cameras));
  out.held_out = std::move(held_out.within);
  out.beyond = held_out.beyond.size();
  for (scene::Camera& camera : held_out.beyond) out.held_out.push_back(std::move(camera));
  put_scenes(plan, out);
  put_wish(plan, out);
  return out;
}

/// Every eighth photo judges, as is usual in the field; the one that says where the thing stands is the first of the
/// others.
void part_cameras(const Backdrop& backdrop, const std::string& first, CapturedCase& out) {
  for (std::size_t i = 0; i < backdrop.photos.size(); ++i) {
    const scene::Camera& camera = backdrop.photos[i].camera;
    if (camera.name == first)
      out.cameras.insert(out.cameras.begin(), camera);
    else
      (i % hold_out == 0 ? out.held_out : out.cameras).push_back(camera);
  }
}

/// The scene of one side, and the rows of it that move.
struct Shown {
  const scene::GaussianCloud& cloud;
  const std::vector<std::uint32_t>& rows;
};
Shown shown_of(const CapturedCase& the_case, Side side) {
  if (side == Side::before) return {the_case.before, the_case.part_before};
  return {the_case.after, the_case.part_after};
}

/// Photos of a case that is drawn into them, and the points that a reconstruction would find there.
Capture drawn_capture(const CapturedCase& the_case, Side side, std::uint64_t seed_for_points) {
  const auto& [cloud, rows] = shown_of(the_case, side);
  Capture out;
  for (const scene::Camera& camera : the_case.cameras)
    out.photos.push_back(fit::to_photo(camera, true_photograph(the_case, side, camera)));
  out.points = points_beside(*the_case.backdrop, the_case.cameras, cloud, rows);
  const auto of_thing = sparse_points(scene::gather(cloud, rows), the_case.cameras, the_case.points, seed_for_points);
  out.points.insert(out.points.end(), of_thing.begin(), of_thing.end());
  return out;
}

}  // namespace

const std::vector<std::string>& captured_case_names() {
  static const std::vector<std::string> names = evaluate::names_of_cases(known_plans());
  return names;
}

Result<std::vector<std::string>> choose_captured_cases(const std::vector<std::string>& names) {
  return evaluate::choose_names(known_plans(), names, kind);
}

Result<CapturedCase> make_captured_case(const std::string& name, std::uint32_t take) {
  const auto known = evaluate::find_case(known_plans(), name, kind);
  if (!known) return propagate(known);
  return carry_out(name, take, (*known)->make());
}

Result<CapturedCase> make_drawn_case(const std::string& name, std::shared_ptr<const Backdrop> backdrop,
                                     const Stand& stand) {
  const auto known = evaluate::find_case(known_plans(), name, kind);
  if (!known) return propagate(known);
  const auto standing = stand_in((*known)->make(), *backdrop, stand);
  if (!standing) return propagate(standing);
  const auto& [plan, scale] = *standing;
  CapturedCase out;
  out.name = name + "_in_" + backdrop->name;
  out.is_test = plan.is_test;
  part_cameras(*backdrop, stand.view, out);
  if (out.held_out.empty())
    return fail(ErrorCode::unprocessable,
                "every eighth photo is to judge, but for the one named, and of " +
                    std::to_string(backdrop->photos.size()) + " that leaves none: name another, or bring more",
                "view");
  out.before = out.after = backdrop->scene;
  put_things(plan, scale, out);
  note_what_moves({}, scale, out);
  put_wish(plan, out);
  out.points.count = points_on_thing;
  out.points.noise *= scale, out.points.outlier_reach *= scale;
  out.backdrop = std::move(backdrop);
  return out;
}

scene::Image true_photograph(const CapturedCase& the_case, Side side, const scene::Camera& camera) {
  const auto& [cloud, rows] = shown_of(the_case, side);
  if (!the_case.backdrop) return photograph(cloud, camera);
  const auto photo = photo_named(*the_case.backdrop, camera.name);
  assert(photo);
  return drawn_into(**photo, cloud, rows);
}

Capture capture(const CapturedCase& the_case, Side side) {
  if (the_case.backdrop) return drawn_capture(the_case, side, seed_for(the_case.take, for_points, std::uint32_t(side)));
  const scene::GaussianCloud& cloud = shown_of(the_case, side).cloud;
  const auto number = std::uint32_t(side);
  return {take_photos(cloud, the_case.cameras, the_case.sensor, seed_for(the_case.take, for_photos, number)),
          sparse_points(cloud, the_case.cameras, the_case.points, seed_for(the_case.take, for_points, number))};
}

}  // namespace engine::captures
