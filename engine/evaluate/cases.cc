#include "engine/evaluate/cases.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <utility>

#include "engine/core/half_axes.h"
#include "engine/core/rng.h"
#include "engine/evaluate/named_cases.h"
#include "engine/evaluate/studio.h"
#include "engine/procedural/demo_scene.h"
#include "engine/procedural/light.h"
#include "engine/procedural/materials.h"
#include "engine/procedural/objects.h"
#include "engine/procedural/surfels.h"
#include "engine/render/largest_weight.h"
#include "engine/scene/rotate_sh.h"
#include "engine/scene/sh.h"

namespace engine::evaluate {
namespace {

constexpr double pi = std::numbers::pi;
// These figures are choices, and part of the definition of the cases: whoever changes one cannot compare results with
// docs/tradeoff.md any more.
constexpr std::uint64_t seed = 7;  // of all that is random in a case
// A Gaussian that no camera of the capture blends with more than this weight is not in the scene: nothing would have
// trained it.
constexpr float min_weight = 0.02f;
// A Gaussian that the cameras blend with less than fair_weight was hardly trained: its colour (0..1) is off by up to
// worst_colour_error, the more so the smaller its weight.
constexpr float fair_weight = 0.05f, worst_colour_error = 0.5f;
constexpr int held_out_every = 5;  // one camera in five judges and is not part of the capture

/// How a point of the part moves: turned about the pivot, drawn to both sides of it, shifted.
struct Motion {
  DQuat turn{1, 0, 0, 0};
  DVec3 pivot{0.0};  ///< World units.
  DVec3 shift{0.0};  ///< World units.
  double widen = 0;  ///< What is `reach` or more to the left or right of the pivot moves away by this, world units;
  double reach = 1;  ///< what is nearer by its part of it.

  [[nodiscard]] DVec3 operator()(DVec3 point) const {
    const DVec3 arm = turn * (point - pivot);
    return pivot + arm + DVec3(widen * std::clamp(arm.x / reach, -1.0, 1.0), 0, 0) + shift;
  }
};

/// A thing that is moved, or that only the edited scene has (what a drawn-out part grows).
struct Part {
  procedural::Object object;
  Motion motion = {};
  bool only_after = false;
};

/// What a case is made from.
struct Plan {
  std::string what;
  std::vector<procedural::Object> surroundings = {};
  std::vector<Part> parts = {};
  edit::Request request = {};
  float spacing = 0.018f;  ///< Distance between Gaussians of a surface, world units.
  int views = 30, width = 480, height = 360;
  double zoom = 1;  ///< Factor of the focal lengths; below 1 everything is smaller in the picture.
  bool textured = true;
};

Vec3 at(float x, float height, float z) { return {x, -height, z}; }
DVec3 dat(double x, double height, double z) { return {x, -height, z}; }

procedural::Object crate(procedural::Placement placement, float side, float height) {
  return {"crate", placement,
          procedural::box({0, 0, 0}, {side, height, side}, procedural::cloth_cover(procedural::srgb(60, 92, 150)), 2)};
}

edit::Handle handle(DVec3 source, std::optional<DVec3> target, double radius, int group = 0) {
  return {source, target, radius, group};
}

edit::Request drag(std::vector<edit::Handle> handles, std::optional<edit::Region> region = {}) {
  edit::Request request;
  request.handles = std::move(handles);
  request.region = region;
  return request;
}

/// Everything above the table top within a square around `middle`.
edit::Region above_table(DVec3 middle, double side, double height) {
  return {{middle.x, -0.004 - height / 2, middle.z}, {side, height, side}};
}

Plan slide() {
  const DVec3 shift = dat(0.85, 0, 0.05), foot = dat(-0.45, 0, -0.35);
  Plan plan{.what = "A blue crate moved across a wooden table."};
  plan.surroundings = furnished_room();
  plan.parts = {{crate({Vec3(foot), 0.3f}, 0.42f, 0.36f), {.shift = shift}}};
  const DVec3 middle = foot + dat(0, 0.18, 0);
  plan.request = drag({handle(middle, middle + shift, 0.42)}, above_table(foot, 0.8, 0.5));
  plan.spacing = 0.03f, plan.width = 240, plan.height = 180;
  return plan;
}

Plan lift() {
  const DVec3 shift = dat(0.1, 0.55, 0), foot = dat(-0.75, 0.25, 1.05);
  Plan plan{.what = "A hanging ball lifted before a wall with prints."};
  plan.surroundings = furnished_room();
  plan.parts = {
      {procedural::make_ball({Vec3(foot), 0}, 0.26f, procedural::srgb(240, 232, 214), procedural::srgb(150, 40, 30)),
       {.shift = shift}}};
  const DVec3 middle = foot + dat(0, 0.26, 0);
  plan.request = drag({handle(middle, middle + shift, 0.28)});
  return plan;
}

/// A pole of `blocks` rings in two colours; each is a thing of its own, so that a longer pole has the same Gaussians.
procedural::Object ring(Vec3 foot, float radius, float height, bool red) {
  const Vec3 colour = red ? procedural::srgb(190, 40, 30) : procedural::srgb(236, 230, 220);
  return {"ring",
          {foot, 0},
          {procedural::lathe({{radius, 0}, {radius, height}}, procedural::plain(colour, 0.1f), 2.0f, 40),
           procedural::lathe({{radius, height}, {0, height}}, procedural::plain(colour, 0.1f), 2.0f, 40)}};
}

Plan pole() {
  constexpr int rings = 8, more = 4, dragged = 4;
  constexpr float height = 0.09f, radius = 0.10f;
  Plan plan{.what = "A striped pole drawn out to one and a half of its length.", .textured = false};
  plan.surroundings = furnished_room();
  const auto foot = [&](int k) { return at(0.1f, float(k) * height, -0.1f); };
  for (int k = 0; k < rings - dragged; ++k) plan.surroundings.push_back(ring(foot(k), radius, height, k % 2 == 0));
  const double rise = double(more) * double(height);
  for (int k = rings - dragged; k < rings; ++k)
    plan.parts.push_back({ring(foot(k), radius, height, k % 2 == 0), {.shift = dat(0, rise, 0)}});
  for (int k = rings - dragged; k < rings - dragged + more; ++k)
    plan.parts.push_back({ring(foot(k), radius, height, k % 2 == 0), {}, true});
  const DVec3 middle = DVec3(foot(rings - dragged)) + dat(0, 0.5 * dragged * double(height), 0);
  plan.request = drag({handle(middle, middle + dat(0, rise, 0), 0.26)},
                      edit::Region{middle, {0.3, dragged * double(height) + 0.004, 0.3}});
  plan.request.mode = edit::Mode::extend;
  return plan;
}

Plan arm() {
  constexpr float length = 0.5f, thick = 0.17f;
  Plan plan{.what = "A jointed arm that lies on a table, raised at the shoulder and bent at the elbow."};
  plan.surroundings = furnished_room();
  const Vec3 shoulder = at(-0.75f, 0.5f * thick, -0.15f);
  plan.surroundings.push_back(
      {"stand",
       {at(-0.85f, 0, -0.15f), 0},
       procedural::box({0, 0, 0}, {0.16f, 0.3f, 0.16f}, procedural::plain(procedural::srgb(90, 90, 96), 0.1f), 2)});
  const auto segment = [&](float along, const procedural::Material& material) {
    return procedural::Object{"segment",
                              {shoulder + Vec3(along + 0.5f * length, 0.5f * thick, 0), 0},
                              procedural::box({0, 0, 0}, {length, thick, thick}, material, 2.2f)};
  };
  const DVec3 from(shoulder), elbow = from + DVec3(double(length), 0, 0);
  const DQuat raise = glm::angleAxis(-35 * pi / 180, DVec3(0, 0, 1)),
              bend = glm::angleAxis(-20 * pi / 180, DVec3(0, 0, 1));
  const Motion upper{.turn = raise, .pivot = from};
  const DVec3 moved_elbow = upper(elbow);
  const Motion lower{.turn = bend * raise, .pivot = elbow, .shift = moved_elbow - elbow};
  plan.parts = {{segment(0, procedural::cloth_cover(procedural::srgb(170, 120, 40))), upper},
                {segment(length, procedural::cloth_cover(procedural::srgb(60, 110, 70))), lower}};
  std::vector<edit::Handle> handles;
  for (const double along : {0.0, 0.17, 0.34}) {
    const DVec3 point = from + DVec3(along + 0.08, 0, 0);
    handles.push_back(handle(point, upper(point), 0.19, 1));
  }
  for (const double along : {0.5, 0.67, 0.84}) {
    const DVec3 point = from + DVec3(along + 0.08, 0, 0);
    handles.push_back(handle(point, lower(point), 0.19, 2));
  }
  plan.request =
      drag(std::move(handles), edit::Region{from + dat(0.5, 0.004, 0), {1.002, double(thick), double(thick) + 0.008}});
  return plan;
}

Plan bush() {
  constexpr float thick = 0.17f;
  const DVec3 foot = dat(0, 0, -0.1), top = foot + dat(0, double(procedural::soil_height), 0);
  Plan plan{.what = "A leafy bush on a post, widened to both sides.", .textured = false};
  plan.surroundings = {procedural::make_room(-1.5f),
                       procedural::make_table({}, {3.7f, 1.5f, 2.1f}),
                       {"post",
                        {Vec3(foot), 0.3f},
                        procedural::box({0, 0, 0}, {thick, procedural::soil_height, thick},
                                        procedural::plain(procedural::srgb(178, 92, 60), 0.1f), 2)}};
  const procedural::Plant plant = procedural::make_plant({Vec3(foot), 0}, 40, seed);
  const Motion motion{.pivot = top, .widen = 0.8, .reach = 1.0};
  plan.parts = {{plant.object, motion}};
  std::vector<edit::Handle> handles;
  for (const procedural::Blade& blade : plant.blades)
    for (const float along : {0.15f, 0.55f, 0.95f}) {
      const DVec3 point = foot + DVec3(blade.midrib(along));
      handles.push_back(handle(point, motion(point), 0.3));
    }
  for (const double below : {0.04, 0.12, 0.2})  // the post stays
    handles.push_back(handle(top - dat(0, below, 0), std::nullopt, 0.12));
  plan.request = drag(std::move(handles), edit::Region{top + dat(0, 0.42, 0), {2.2, 1.3, 2.2}});
  return plan;
}

Plan apart() {
  const DVec3 left = dat(-0.22, 0, -0.45), right = dat(0.24, 0, -0.40);
  const DVec3 to_left = dat(-0.5, 0, 0.05), to_right = dat(0.5, 0, -0.1);
  Plan plan{.what = "A mug and an apple moved apart, each by a group of its own."};
  plan.surroundings = furnished_room();
  plan.parts = {{procedural::make_mug({Vec3(left), 2.4f}), {.shift = to_left}},
                {procedural::make_apple({Vec3(right), 0.4f}, 0.18f), {.shift = to_right}}};
  const DVec3 mug = left + dat(0, 0.2, 0), apple = right + dat(0, 0.17, 0);
  plan.request = drag({handle(mug, mug + to_left, 0.36, 1), handle(apple, apple + to_right, 0.27, 2)},
                      edit::Region{dat(0, 0.304, -0.4), {1.4, 0.6, 0.9}});
  return plan;
}

Plan distance() {
  const DVec3 foot = dat(-1.35, 0, -0.55), shift = dat(2.6, 0, 0.35);
  Plan plan{.what = "An apple moved over the whole table, many radii far."};
  plan.surroundings = furnished_room();
  plan.parts = {{procedural::make_apple({Vec3(foot), 0.4f}, 0.16f), {.shift = shift}}};
  const DVec3 middle = foot + dat(0, 0.16, 0);
  plan.request = drag({handle(middle, middle + shift, 0.24)}, above_table(foot, 0.5, 0.5));
  return plan;
}

Plan speck() {
  const DVec3 foot = dat(0.1, 0, -0.3), shift = dat(0.28, 0, 0.1);
  Plan plan{.what = "An apple moved on a table far from the cameras."};
  plan.surroundings = furnished_room();
  plan.parts = {{procedural::make_apple({Vec3(foot), 0.4f}, 0.12f), {.shift = shift}}};
  const DVec3 middle = foot + dat(0, 0.12, 0);
  plan.request = drag({handle(middle, middle + shift, 0.19)}, above_table(foot, 0.4, 0.4));
  plan.spacing = 0.03f, plan.width = 240, plan.height = 180, plan.zoom = 0.6;
  return plan;
}

struct Known {
  std::string name;
  Plan (*plan)();
  bool small = false;
};

constexpr const char* kind = "case";  // as errors call it

const std::vector<Known>& known_cases() {
  static const std::vector<Known> all{{"slide", slide, true}, {"lift", lift},        {"pole", pole},
                                      {"arm", arm},           {"bush", bush},        {"apart", apart},
                                      {"distance", distance}, {"speck", speck, true}};
  return all;
}

/// Row i of the cloud, a flat disc across its third axis, drawn out with what it lies on: a surface that grows stays
/// closed. For motions that do not turn.
void widen_row(scene::GaussianCloud& cloud, std::size_t i, const Motion& motion) {
  const DMat3 axes = glm::mat3_cast(glm::normalize(DQuat(cloud.rotation.get(i))));
  const DVec3 extent = glm::exp(DVec3(cloud.log_scale.get(i)));
  const DVec3 middle(cloud.mean.get(i));
  const auto drawn = [&](int axis) { return motion(middle + extent[axis] * axes[axis]) - motion(middle); };
  const auto [longer, shorter] = half_axes(drawn(0), drawn(1));  // what was drawn out is no longer at right angles
  const DVec3 u = glm::normalize(longer), v = glm::normalize(shorter);
  cloud.rotation.set(i, Quat(glm::quat_cast(DMat3(u, v, glm::cross(u, v)))));
  cloud.log_scale.set(i, Vec3(glm::log(DVec3(glm::length(longer), glm::length(shorter), extent.z))));
}

/// Row i of the cloud, carried along by the motion.
void move_row(scene::GaussianCloud& cloud, std::size_t i, const Motion& motion, const scene::ShRotation& sh) {
  assert(motion.widen == 0 || motion.turn == DQuat(1, 0, 0, 0));
  if (motion.widen != 0) widen_row(cloud, i, motion);
  cloud.mean.set(i, Vec3(motion(DVec3(cloud.mean.get(i)))));
  if (motion.turn == DQuat(1, 0, 0, 0)) return;
  cloud.rotation.set(i, Quat(motion.turn * DQuat(cloud.rotation.get(i))));
  const std::size_t coefficients = scene::sh_coefficients(cloud.sh_degree);
  for (std::size_t c = 0; c < 3; ++c) scene::rotate_sh(sh, cloud.sh_row(i).subspan(c * coefficients, coefficients));
}

std::vector<std::uint32_t> range(std::size_t first, std::size_t last) {
  std::vector<std::uint32_t> rows(last - first);
  std::iota(rows.begin(), rows.end(), std::uint32_t(first));
  return rows;
}

/// What a training does to Gaussians that no picture shows well.
///   weight  [rows] largest blending weight over the cameras of the capture
void spoil_colours(std::span<const float> weight, scene::GaussianCloud& cloud) {
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (weight[i] >= fair_weight) continue;
    const float error = worst_colour_error * (fair_weight - weight[i]) / (fair_weight - min_weight);
    Rng rng(seed, i);
    for (std::size_t c = 0; c < 3; ++c)
      cloud.sh_row(i)[c * scene::sh_coefficients(cloud.sh_degree)] += rng.uniform(-error, error) / float(scene::sh_c0);
  }
}

void place_cameras(const Plan& plan, Case& out) {
  auto cameras = procedural::make_arc_cameras(plan.views, plan.width, plan.height);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    cameras[i].fx *= plan.zoom, cameras[i].fy *= plan.zoom;
    (i % held_out_every == held_out_every - 1 ? out.held_out : out.cameras).push_back(cameras[i]);
  }
}

Case carry_out(const std::string& name, const Plan& plan) {
  Case out;
  out.name = name, out.what = plan.what, out.textured = plan.textured;
  out.request = plan.request;
  place_cameras(plan, out);

  const procedural::Light light = studio_light();
  const procedural::Surfels around = procedural::cover_all(plan.surroundings, light, out.cameras, plan.spacing, seed);
  std::vector<procedural::Object> things;
  for (const Part& part : plan.parts) things.push_back(part.object);
  const procedural::Surfels moved = procedural::cover_all(things, light, out.cameras, plan.spacing, seed + 1);

  const std::size_t rows_around = around.cloud.size(), rows_moved = moved.cloud.size();
  out.truth = around.cloud;
  scene::append_rows(out.truth, moved.cloud, range(0, rows_moved));
  out.part = range(rows_around, rows_around + rows_moved);
  std::vector<std::uint32_t> there_before;
  for (std::size_t i = 0; i < rows_moved; ++i)
    if (!plan.parts[moved.object[i]].only_after) there_before.push_back(std::uint32_t(i));
  scene::GaussianCloud whole = around.cloud;
  scene::append_rows(whole, moved.cloud, there_before);
  std::vector<scene::ShRotation> sh;
  for (const Part& part : plan.parts) sh.push_back(scene::sh_rotation(part.motion.turn));
  for (std::size_t i = 0; i < rows_moved; ++i)
    move_row(out.truth, rows_around + i, plan.parts[moved.object[i]].motion, sh[moved.object[i]]);

  const std::vector<float> weight = render::largest_weights(whole, out.cameras);
  std::vector<std::uint8_t> seen(whole.size());
  std::size_t kept = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    seen[i] = weight[i] >= min_weight;
    if (seen[i] && i >= rows_around) {
      out.part_before.push_back(std::uint32_t(kept));
      out.part_after.push_back(std::uint32_t(rows_around + there_before[i - rows_around]));
    }
    kept += seen[i];
  }
  spoil_colours(weight, whole);
  out.before = scene::select(whole, seen);
  return out;
}

}  // namespace

bool is_small(const std::string& name) {
  return std::any_of(known_cases().begin(), known_cases().end(),
                     [&](const Known& known) { return known.small && known.name == name; });
}

const std::vector<std::string>& case_names() {
  static const std::vector<std::string> names = names_of_cases(known_cases());
  return names;
}

Result<std::vector<std::string>> choose_cases(const std::vector<std::string>& names, bool small_only) {
  auto chosen = choose_names(known_cases(), names, kind);
  if (!chosen) return chosen;
  if (small_only) std::erase_if(*chosen, [](const std::string& name) { return !is_small(name); });
  if (chosen->empty()) return fail(ErrorCode::invalid_argument, "none of these cases is small");
  return chosen;
}

Result<Case> make_case(const std::string& name) {
  const auto known = find_case(known_cases(), name, kind);
  if (!known) return propagate(known);
  return carry_out(name, (*known)->plan());
}

}  // namespace engine::evaluate
