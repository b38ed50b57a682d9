// Things that are moved, turned, scaled, drawn out. Figures are world units, and part of the definition of the cases.
#include <cmath>
#include <utility>

#include "engine/captures/plan.h"
#include "engine/captures/plan_parts.h"
#include "engine/evaluate/studio.h"
#include "engine/procedural/materials.h"
#include "engine/procedural/objects.h"

namespace engine::captures {
namespace {

using procedural::box;
using procedural::lathe;
using procedural::Object;
using procedural::plain;
using procedural::srgb;
using procedural::wood;

/// A round table of radius 0.62 on one leg.
Object side_table() {
  const procedural::Material top = wood(srgb(206, 158, 108), srgb(132, 82, 46), 0.23f);
  return {"side table",
          {},
          {lathe({{0, -0.06f}, {0.60f, -0.06f}, {0.62f, -0.03f}, {0.60f, 0}, {0, 0}}, top, 1, 64),
           lathe({{0.06f, -1.45f}, {0.05f, -0.06f}}, plain(srgb(70, 56, 46)), 0.6f, 24),
           lathe({{0.40f, -1.5f}, {0.38f, -1.46f}, {0.06f, -1.43f}}, plain(srgb(70, 56, 46)), 0.6f, 40)}};
}

Plan mug_on_side_table() {
  const DVec3 foot = dat(-0.24, 0, -0.12), shift = dat(0.46, 0, -0.05);
  Plan plan{.what = "A mug moved across a small round table, which covers little of the picture."};
  plan.surroundings = {procedural::make_room(-1.5f), side_table(),
                       procedural::make_framed_print({at(-0.4f, 0.35f, 1.40f), 0}, 1.6f, 1.1f)};
  plan.things = {{procedural::make_mug({Vec3(foot), 0.4f}), shifted(shift)}};
  plan.glossy = {"mug"};
  plan.orbit = {.target = dat(0, -0.1, 0), .distance = 4.0};
  plan.grips = {{foot + dat(0, 0.22, -0.18), 0.46}};
  plan.region = standing_on(0, foot, {0.8, 0.5, 0.6});
  plan.clicks = {{foot + dat(0, 0.3, -0.17), foot + dat(-0.1, 0.1, -0.15)},
                 {dat(0.3, 0, -0.2), dat(0, 0, -0.45), dat(-0.3, 0.6, 1.4)}};
  return plan;
}

Plan mug_selected_carelessly() {
  Plan plan = mug_on_side_table();
  plan.what = "The mug on the side table, selected badly.";
  plan.region.reset();
  plan.careless = Carelessness{};
  return plan;
}

/// A piece of a barrel whose axis runs along z; its crown is at height 0.
Object barrel(float radius) {
  constexpr float half_angle = 1.0f, half_length = 0.9f;
  procedural::Patch shell{.position =
                              [=](float u, float v) {
                                const float a = (2 * u - 1) * half_angle;
                                return at(radius * std::sin(a), radius * (std::cos(a) - 1), (2 * v - 1) * half_length);
                              },
                          .material = checks(srgb(190, 178, 150), srgb(70, 96, 120), 0.17f),
                          .cells_u = 32,
                          .cells_v = 4,
                          .density = 1,
                          .two_sided = true};
  const float edge = radius * (std::cos(half_angle) - 1);
  Object out{"barrel", {}, {std::move(shell)}};
  append(out.patches, box(at(0, -1.5f, 0), {2 * radius * std::sin(half_angle), 1.5f + edge, 2 * half_length},
                          plain(srgb(120, 96, 76)), 0.6f));
  return out;
}

Plan apple_on_barrel() {
  constexpr double radius = 1.1;
  const DVec3 axis = dat(0, -radius, 0), along(0, 0, 1);
  const Motion pose = turned(axis, along, -24 * degree);
  Plan plan{.what = "An apple rolled over the crown of a barrel, leaning with the curve.", .is_test = true};
  plan.surroundings = {procedural::make_room(-1.5f), barrel(float(radius)),
                       procedural::make_framed_print({at(0.5f, 0.75f, 1.40f), 0}, 1.5f, 1.1f)};
  plan.things = {{procedural::make_apple({at(0, 0, -0.35f), 0.4f}, 0.2f), turned(axis, along, 44 * degree), pose}};
  plan.glossy = {"apple"};
  plan.orbit = {.target = dat(0, 0, -0.2), .distance = 3.2, .lowest = 14, .highest = 38};
  const auto on_apple = [&](double x, double height, double z) { return pose(dat(x, height, z - 0.35)); };
  plan.grips = {
      {on_apple(-0.13, 0.2, -0.12), 0.33}, {on_apple(0.13, 0.2, -0.12), 0.33}, {on_apple(0.02, 0.32, -0.12), 0.33}};
  plan.clicks = {{on_apple(0, 0.2, -0.19), on_apple(0.1, 0.3, -0.1)},
                 {pose(dat(0.35, 0, -0.4)), pose(dat(-0.35, 0, -0.4)), dat(0.5, 0.75, 1.4)}};
  return plan;
}

/// A quilted pouf, curved both ways; its crown is at height 0.
Object pouf(float radius) {
  constexpr float half_angle = 0.8f;
  constexpr int rings = 16;
  std::vector<procedural::ProfilePoint> profile{{radius * std::sin(half_angle), -1.5f}};
  for (int i = rings; i >= 0; --i) {
    const float a = half_angle * float(i) / rings;
    profile.push_back({radius * std::sin(a), radius * (std::cos(a) - 1)});
  }
  return {"pouf", {}, {lathe(profile, checks(srgb(196, 150, 120), srgb(120, 66, 74), 0.13f), 1, 64)}};
}

Plan ball_on_pouf() {
  constexpr double radius = 1.3, ball = 0.2;
  const DVec3 middle = dat(0, -radius, 0), along(0.2, 0, 1);
  const Motion pose = turned(middle, along, 15 * degree);
  Plan plan{.what = "A ball rolled over the crown of a pouf, which is curved both ways."};
  plan.surroundings = {procedural::make_room(-1.5f), pouf(float(radius)),
                       procedural::make_framed_print({at(-0.4f, 0.75f, 1.40f), 0}, 1.6f, 1.1f)};
  plan.things = {{procedural::make_ball({at(0, 0, -0.25f), 0.7f}, float(ball), srgb(238, 226, 200), srgb(30, 96, 104)),
                  turned(middle, along, -32 * degree), pose}};
  plan.glossy = {"ball"};
  plan.orbit = {.target = dat(0, 0, -0.2), .distance = 3.2, .lowest = 16, .highest = 40};
  const auto on_ball = [&](double x, double height, double z) { return pose(dat(x, height, z - 0.25)); };
  plan.grips = {{on_ball(-0.13, 0.2, -0.14), 0.33}, {on_ball(0.13, 0.2, -0.14), 0.33}, {on_ball(0, 0.32, -0.14), 0.33}};
  plan.clicks = {{on_ball(0, 0.2, -0.2), on_ball(0.1, 0.33, -0.1)},
                 {pose(dat(0.3, -0.05, -0.3)), pose(dat(-0.3, -0.05, -0.3)), dat(-0.4, 0.75, 1.4)}};
  return plan;
}

Plan crate_before_clutter() {
  const DVec3 foot = dat(-0.42, 0, -0.62), shift = dat(0.86, 0, 0.03);
  Plan plan{.what = "A crate moved aside before a table full of things.", .is_test = true};
  plan.surroundings = evaluate::furnished_room();
  for (Object& object : std::vector<Object>{
           procedural::make_book({at(-0.75f, 0, 0.2f), 0.12f}, {0.8f, 0.15f, 0.6f}, srgb(46, 78, 86)),
           procedural::make_book({at(-0.72f, 0.15f, 0.22f), -0.1f}, {0.7f, 0.11f, 0.5f}, srgb(168, 62, 48)),
           procedural::make_mug({at(-0.05f, 0, 0.05f), 2.4f}),
           procedural::make_apple({at(0.35f, 0, 0.3f), 0.4f}, 0.17f),
           procedural::make_apple({at(-0.35f, 0, -0.13f), 1.4f}, 0.13f),
           procedural::make_ball({at(0.85f, 0, 0.25f), 0}, 0.22f, srgb(240, 232, 214), srgb(38, 84, 124)),
           procedural::make_apple({at(-0.7f, 0.26f, 0.2f), 0.7f}, 0.14f)})
    plan.surroundings.push_back(std::move(object));
  plan.things = {
      {{"crate",
        {Vec3(foot), 0.3f},
        box({0, 0, 0}, {0.4f, 0.34f, 0.34f}, checks(srgb(214, 176, 92), srgb(150, 60, 44), 0.1f), on_things)},
       shifted(shift)}};
  plan.glossy = {"mug", "ball", "apple"};
  plan.orbit = {.target = dat(0, 0.15, -0.2), .distance = 3.5, .lowest = 14};
  plan.grips = {{foot + dat(-0.05, 0.2, -0.2), 0.5}};
  plan.region = standing_on(0, foot, {0.58, 0.5, 0.54});
  plan.clicks = {{foot + dat(0, 0.2, -0.2), foot + dat(-0.05, 0.34, 0)},
                 {dat(-0.85, 0.1, -0.1), dat(-0.05, 0.25, -0.15), foot + dat(0.1, 0, -0.4)}};
  return plan;
}

Plan block_turned() {
  const DVec3 foot = dat(0.05, 0, -0.3);
  const float turn = 0.35f;
  const Motion motion = turned(foot, {0, 1, 0}, 50 * degree);
  Plan plan{.what = "A long block turned by 50 degrees about its own upright axis."};
  plan.surroundings = evaluate::furnished_room();
  const Object block{
      "block",
      {Vec3(foot), turn},
      box({0, 0, 0}, {0.62f, 0.26f, 0.3f}, checks(srgb(226, 220, 206), srgb(52, 110, 84), 0.13f), on_things)};
  const auto on_block = [&](float x, float height, float z) { return DVec3(block.placement.world(at(x, height, z))); };
  plan.things = {{block, motion}};
  plan.orbit = {.target = dat(0, 0.1, -0.2), .distance = 3.2, .lowest = 16, .highest = 40};
  plan.grips = {{on_block(-0.24f, 0.26f, -0.09f), 0.36},
                {on_block(0.24f, 0.26f, -0.09f), 0.36},
                {on_block(0, 0.26f, 0.11f), 0.36}};
  plan.region = standing_on(0, foot, {0.9, 0.4, 0.7});
  plan.clicks = {{on_block(-0.2f, 0.26f, 0), on_block(0.1f, 0.13f, -0.15f), on_block(0.25f, 0.26f, 0)},
                 {on_block(0, 0, -0.4f), on_block(0.5f, 0, 0), on_block(-0.5f, 0, 0)}};
  return plan;
}

Plan board_slid() {
  const DVec3 foot = dat(-0.25, 0, -0.3);
  const Object board{
      "board",
      {Vec3(foot), 0.25f},
      box({0, 0, 0}, {0.7f, 0.05f, 0.5f}, checks(srgb(232, 222, 196), srgb(96, 38, 34), 0.12f), on_things)};
  const auto on_board = [&](float x, float z) { return DVec3(board.placement.world(at(x, 0.05f, z))); };
  Plan plan{.what = "A chequered board, thin and flat on a table, slid aside."};
  plan.surroundings = evaluate::furnished_room();
  plan.things = {{board, shifted(dat(0.55, 0, -0.05))}};
  plan.orbit = {.target = dat(0, 0.05, -0.25), .distance = 3.3, .lowest = 16, .highest = 40};
  plan.grips = {{on_board(0, -0.1f), 0.45}};
  plan.region = standing_on(0, foot, {0.85, 0.2, 0.7});
  plan.clicks = {{on_board(-0.2f, 0), on_board(0.15f, 0.12f), on_board(0.25f, -0.15f)},
                 {on_board(0, -0.4f), on_board(0.5f, 0), on_board(-0.5f, 0)}};
  return plan;
}

Plan ball_scaled() {
  constexpr double radius = 0.2, factor = 1.4;
  const DVec3 foot = dat(-0.1, 0, -0.3);
  Plan plan{.what = "A striped ball made 1.4 times as large where it stands.",
            .said = "Handles only shift and turn: three of them move outward, and what lies between follows them.",
            .is_test = true};
  plan.surroundings = evaluate::furnished_room();
  plan.things = {
      {procedural::make_ball({Vec3(foot), 0}, float(radius), procedural::srgb(240, 232, 214), srgb(150, 40, 30)),
       [=](DVec3 point) { return foot + factor * (point - foot); }}};
  plan.glossy = {"ball"};
  plan.orbit = {.target = dat(-0.05, 0.12, -0.2), .distance = 3.1, .lowest = 14};
  const DVec3 middle = foot + dat(0, radius, 0);
  plan.grips = {{middle + dat(-0.17, 0, -0.09), 0.29},
                {middle + dat(0.17, 0, -0.09), 0.29},
                {middle + dat(0, 0.17, -0.08), 0.29}};
  plan.region = standing_on(0, foot, {0.5, 0.5, 0.5});
  plan.clicks = {{middle + dat(0, 0, -0.2), middle + dat(0.08, 0.1, -0.15)},
                 {foot + dat(0.4, 0, 0), foot + dat(-0.4, 0, 0), foot + dat(0, 0, -0.4)}};
  return plan;
}

/// A piece of a rod that stands on `foot`, whose pattern is counted from there: zigzag rings.
Object rod(Vec3 foot, float from, float to, float period) {
  const procedural::Material zigzag = [=](const procedural::SurfacePoint& p) {
    const float wave = 0.25f * std::abs(2 * (8 * p.u - std::floor(8 * p.u)) - 1);
    const float t = -p.local.y / period + wave;
    const float part = t - std::floor(t);
    const Vec3 color = part < 0.5f ? srgb(34, 74, 92) : part < 0.75f ? srgb(238, 226, 200) : srgb(206, 120, 60);
    return procedural::Finish{color, 0};
  };
  constexpr float radius = 0.1f;
  return {"rod", {foot, 0}, {lathe({{radius, from}, {radius, to}}, zigzag, on_things, 40)}};
}

Plan rod_drawn_out() {
  constexpr double length = 0.5, period = 0.15, more = 2.6 * period, end = 0.16;
  const DVec3 foot = dat(0.05, 0, -0.25), top = foot + dat(0, length, 0);
  Plan plan{.what = "A patterned rod drawn out at its knob by 2.6 times the length of its pattern.", .textured = false};
  plan.surroundings = evaluate::furnished_room();
  plan.surroundings.push_back(rod(Vec3(foot), 0, length, float(period)));
  plan.only_after = {rod(Vec3(foot), length, length + more, float(period))};
  plan.things = {{{"knob",
                   {Vec3(top), 0},
                   {lathe({{0.12f, 0}, {0.14f, 0.03f}, {0.14f, 0.07f}, {0.1f, 0.11f}, {0, 0.12f}},
                          plain(srgb(170, 40, 36)), on_things, 40)}},
                  shifted(dat(0, more, 0))}};
  // The end of the rod is what is drawn out with the knob.
  plan.drawn_from = [=](DVec3 point) {
    const DVec3 from_top = point - top;
    return std::hypot(from_top.x, from_top.z) < 0.12 && from_top.y >= 0 && from_top.y < end;
  };
  plan.mode = edit::Mode::extend;
  plan.orbit = {.target = dat(0.05, 0.5, -0.2), .distance = 3.2};
  plan.grips = {{top + dat(0, 0.02, -0.12), 0.3}};
  plan.region = edit::Region{top + dat(0, 0, 0), {0.34, 2 * end, 0.34}};
  plan.clicks = {{top + dat(0, 0.06, -0.13), top + dat(0.03, -0.08, -0.1)},
                 {foot + dat(0, 0.2, -0.1), foot + dat(0, 0, -0.4)}};
  return plan;
}

/// The same case in a room where things cast shadows, which come along: those of most cases are left out, so that what
/// is there after the edit is as bright as it was before.
Plan with_shadows(Plan plan, std::string what, bool is_test) {
  plan.what = std::move(what);
  plan.casts_shadows = true;
  plan.is_test = is_test;
  return plan;
}

Plan mug_and_shadow() { return with_shadows(mug_on_side_table(), "The mug on the side table and its shadow.", false); }
Plan can_and_shadow() { return with_shadows(can_on_floor(), "The can on the planks and its shadow.", false); }
Plan chair_and_shadow() { return with_shadows(chair_on_carpet(), "The chair on the carpet and its shadow.", false); }
Plan teddy_and_shadow() { return with_shadows(teddy_on_sofa(), "The teddy on the sofa and its shadow.", true); }
Plan clutter_and_shadow() {
  return with_shadows(crate_before_clutter(), "The crate before clutter and its shadow.", true);
}

}  // namespace

const std::vector<NamedPlan>& known_plans() {
  static const std::vector<NamedPlan> all{{"mug", mug_on_side_table},
                                          {"barrel", apple_on_barrel},
                                          {"clutter", crate_before_clutter},
                                          {"pouf", ball_on_pouf},
                                          {"turn", block_turned},
                                          {"board", board_slid},
                                          {"scale", ball_scaled},
                                          {"rod", rod_drawn_out},
                                          {"lid", lid_opened},
                                          {"plant", bent_plant},
                                          {"mouth", opened_mouth},
                                          {"mug_careless", mug_selected_carelessly},
                                          {"mouth_careless", opened_mouth_carelessly},
                                          {"can", can_on_floor},
                                          {"chair", chair_on_carpet},
                                          {"teddy", teddy_on_sofa},
                                          {"lamp", lamp_on_table},
                                          {"door", door_opened},
                                          {"laptop", laptop_opened},
                                          {"mug_shadow", mug_and_shadow},
                                          {"can_shadow", can_and_shadow},
                                          {"chair_shadow", chair_and_shadow},
                                          {"teddy_shadow", teddy_and_shadow},
                                          {"clutter_shadow", clutter_and_shadow},
                                          {"chair_led", chair_led_by_three},
                                          {"lamp_led", lamp_led_by_two},
                                          {"tiles", vase_on_tiles}};
  return all;
}

}  // namespace engine::captures
