// Things as they stand about in people's homes: of several parts and materials, clicked at one of them and moved as a
// whole. Figures are world units, and part of the definition of the cases.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "engine/captures/plan.h"
#include "engine/captures/plan_parts.h"
#include "engine/evaluate/studio.h"
#include "engine/procedural/materials.h"
#include "engine/procedural/objects.h"

namespace engine::captures {
namespace {

using procedural::box;
using procedural::Finish;
using procedural::lathe;
using procedural::Material;
using procedural::Object;
using procedural::Patch;
using procedural::plain;
using procedural::srgb;
using procedural::SurfacePoint;

constexpr float pi = std::numbers::pi_v<float>;

/// An upright ellipsoid.
Patch ellipsoid(Vec3 middle, Vec3 half_axes, Material material, int segments = 32) {
  return {.position =
              [=](float u, float v) {
                const float around = 2 * pi * u, up = (v - 0.5f) * pi;
                return middle + half_axes * Vec3(std::cos(up) * std::cos(around), -std::sin(up),
                                                 std::cos(up) * std::sin(around));
              },
          .material = std::move(material),
          .cells_u = segments,
          .cells_v = segments / 2,
          .density = on_things,
          .closed_u = true};
}

/// A floor of its own covering, its top at height 0, of so much in x and z.
Object covered_floor(float width, float depth, const Material& covering) {
  return {
      "floor", {}, {procedural::quad(at(-0.5f * width, 0, -0.6f * depth), {width, 0, 0}, {0, 0, depth}, covering, 1)}};
}

/// Square tiles with a flower in every other one, each a little lighter or darker than the next, and joints between.
Material tiles(float side) {
  return [=](const SurfacePoint& p) {
    const float x = p.local.x / side, z = p.local.z / side, column = std::floor(x), row = std::floor(z);
    const float u = x - column - 0.5f, v = z - row - 0.5f;
    const bool joint = std::max(std::abs(u), std::abs(v)) > 0.47f;
    const bool has_flower = std::fmod(std::abs(column + row), 2.0f) > 0.5f;
    const float petal = 0.24f + 0.12f * std::cos(4 * std::atan2(v, u));
    const bool flower = has_flower && std::hypot(u, v) < petal;
    const float shade = 1 + 0.05f * std::sin(12.9f * column + 78.2f * row);
    const Vec3 glaze = flower ? srgb(46, 84, 120) : has_flower ? srgb(226, 220, 204) : srgb(176, 112, 84);
    return joint ? Finish{srgb(120, 114, 106), 0} : Finish{shade * glaze, 0.15f};
  };
}

/// A vase with a belly.
Object vase(Vec3 foot) {
  const Material glaze = [](const SurfacePoint& p) {
    const float height = -p.local.y;
    const bool band = std::abs(height - 0.34f) < 0.03f;
    const bool leaf = std::abs(height - 0.17f) < 0.06f && std::sin(7 * std::atan2(p.local.z, p.local.x)) > 0.4f;
    return Finish{band ? srgb(232, 190, 92) : leaf ? srgb(236, 232, 220) : srgb(40, 96, 74), 0};
  };
  return {"vase",
          {foot, 0},
          {lathe({{0.09f, 0},
                  {0.10f, 0.02f},
                  {0.15f, 0.12f},
                  {0.155f, 0.20f},
                  {0.12f, 0.30f},
                  {0.07f, 0.38f},
                  {0.075f, 0.44f},
                  {0.10f, 0.48f}},
                 glaze, on_things, 48)}};
}

/// A printed can with a bare metal foot and lid: the parts of one thing that have nothing of their colours in common.
Object drink_can(Vec3 foot, float turn) {
  constexpr float print_from = 0.045f, print_to = 0.405f;
  const Vec3 metal = srgb(198, 200, 204);
  const Material print = [=](const SurfacePoint& p) {
    const float height = -p.local.y, around = std::atan2(p.local.z, p.local.x);
    const float wave = height - 0.2f - 0.045f * std::sin(2 * around);
    const bool letters = std::abs(height - 0.31f) < 0.035f && std::sin(17 * around) + std::sin(29 * around) > 0.3f;
    if (height < print_from || height > print_to) return Finish{metal, 0};
    if (std::abs(wave) < 0.022f) return Finish{srgb(240, 238, 230), 0};
    return Finish{letters ? srgb(244, 240, 228) : wave < 0 ? srgb(150, 16, 26) : srgb(196, 22, 32), 0};
  };
  Object can{"can",
             {foot, turn},
             {lathe({{0.10f, 0},
                     {0.135f, 0.035f},
                     {0.135f, 0.41f},
                     {0.112f, 0.455f},
                     {0.116f, 0.475f},
                     {0.108f, 0.478f},
                     {0.104f, 0.462f},
                     {0, 0.462f}},
                    print, on_things, 48)}};
  append(can.patches, box(at(0, 0.463f, -0.03f), {0.05f, 0.008f, 0.09f}, plain(srgb(150, 152, 158)), on_things));
  append(can.patches, box(at(0, 0.4625f, -0.072f), {0.03f, 0.002f, 0.02f}, plain(srgb(40, 40, 44)), on_things));
  return can;
}

}  // namespace

Plan can_on_floor() {
  const DVec3 foot = dat(-0.3, 0, -0.15), shift = dat(0.62, 0, -0.08);
  Plan plan{.what = "A drink can with a bare metal lid, moved along a floor of planks."};
  plan.surroundings = {procedural::make_room(-0.03f),
                       covered_floor(4.4f, 2.4f, procedural::wood(srgb(196, 152, 106), srgb(128, 84, 50), 0.19f)),
                       procedural::make_book({at(0.75f, 0, 0.45f), 0.5f}, {0.7f, 0.12f, 0.5f}, srgb(52, 82, 60)),
                       procedural::make_framed_print({at(-0.5f, 1.1f, 1.40f), 0}, 1.4f, 1.0f)};
  plan.things = {{drink_can(Vec3(foot), 0.4f), shifted(shift)}};
  plan.glossy = {"can"};
  plan.orbit = {.target = dat(0, 0.15, -0.1), .distance = 3.0, .lowest = 14, .highest = 42};
  plan.grips = {{foot + dat(0, 0.25, -0.135), 0.32}};
  plan.region = standing_on(0, foot, {0.4, 0.56, 0.4});
  plan.clicks = {{foot + dat(0.02, 0.22, -0.135), foot + dat(-0.05, 0.462, 0)},
                 {foot + dat(0, 0, -0.35), foot + dat(0.35, 0, 0), dat(-0.5, 1.1, 1.4)}};
  return plan;
}

Plan vase_on_tiles() {
  const DVec3 foot = dat(-0.25, 0, -0.2), shift = dat(0.6, 0, 0.1);
  Plan plan{.what = "A vase moved along a floor of patterned tiles.", .is_test = true};
  plan.surroundings = {procedural::make_room(-0.03f), covered_floor(4.4f, 2.4f, tiles(0.17f)),
                       procedural::make_book({at(0.8f, 0, 0.45f), 0.3f}, {0.6f, 0.1f, 0.4f}, srgb(96, 40, 52)),
                       procedural::make_framed_print({at(-0.4f, 1.1f, 1.40f), 0}, 1.2f, 0.9f)};
  plan.things = {{vase(Vec3(foot)), shifted(shift)}};
  plan.glossy = {"vase"};
  plan.orbit = {.target = dat(0, 0.15, -0.1), .distance = 3.0, .lowest = 14, .highest = 42};
  plan.grips = {{foot + dat(0.02, 0.22, -0.15), 0.34}};
  plan.region = standing_on(0, foot, {0.44, 0.6, 0.44});
  plan.clicks = {{foot + dat(0.03, 0.25, -0.13), foot + dat(-0.05, 0.08, -0.1)},
                 {foot + dat(0, 0, -0.35), foot + dat(0.35, 0, 0), dat(-0.5, 1.1, 1.4)}};
  return plan;
}

Plan chair_on_carpet() {
  const DVec3 foot = dat(-0.35, 0, 0.1), shift = dat(0.85, 0, 0.04);
  constexpr float half_width = 0.22f, half_depth = 0.21f, seat = 0.44f, tall = 0.95f, bar = 0.045f;
  const Material paint = plain(srgb(70, 104, 122));
  Object chair{"chair", {Vec3(foot), 0.35f}, {}};
  for (const float x : {-1.0f, 1.0f}) {
    append(chair.patches, box(at(x * half_width, 0, -half_depth), {bar, seat, bar}, paint, on_things));
    append(chair.patches, box(at(x * half_width, 0, half_depth), {bar, tall, bar}, paint, on_things));
  }
  for (const float height : {0.58f, 0.70f, 0.84f})
    append(chair.patches, box(at(0, height, half_depth), {2 * half_width, 0.06f, 0.02f}, paint, on_things));
  const Material wicker = [](const SurfacePoint& p) {
    const float weave = std::sin(70 * p.local.x) * std::sin(70 * p.local.z);
    return Finish{srgb(214, 182, 124) * (1 + 0.22f * weave), 0};
  };
  append(chair.patches, box(at(0, seat, 0), {2 * half_width + bar, 0.035f, 2 * half_depth + bar}, wicker, on_things));
  const Material carpet = [](const SurfacePoint& p) {
    const float x = p.local.x / 0.34f, z = p.local.z / 0.34f;
    const float diamond = std::abs(x - std::round(x)) + std::abs(z - std::round(z));
    const Vec3 color = diamond < 0.2f ? srgb(206, 182, 132) : diamond > 0.46f ? srgb(58, 52, 74) : srgb(134, 52, 50);
    return Finish{color * (1 + 0.12f * procedural::fractal_noise(14.0f * p.local, 2)), 0};
  };
  Plan plan{.what = "A chair moved along a carpet, which is seen between its four legs."};
  plan.surroundings = {procedural::make_room(-0.03f), covered_floor(4.4f, 2.4f, carpet),
                       procedural::make_framed_print({at(0.6f, 1.5f, 1.40f), 0}, 1.2f, 0.9f)};
  plan.things = {{chair, shifted(shift)}};
  plan.orbit = {.target = dat(0, 0.4, 0), .distance = 4.0, .lowest = 12, .highest = 38};
  const auto on_chair = [&](float x, float height, float z) { return DVec3(chair.placement.world(at(x, height, z))); };
  plan.grips = {{on_chair(0, seat + 0.035f, -0.1f), 0.62}};
  plan.region = standing_on(0, foot, {0.75, 1.0, 0.75});
  plan.clicks = {{on_chair(0.03f, seat + 0.035f, -0.1f), on_chair(0, 0.73f, half_depth),
                  on_chair(-half_width, 0.2f, -half_depth - 0.5f * bar)},
                 {on_chair(0, 0, -0.6f), on_chair(0.1f, 0, 0), on_chair(0.7f, 0, 0)}};
  return plan;
}

Plan chair_led_by_three() {
  Plan plan = chair_on_carpet();
  plan.what = "The chair on the carpet, led by three handles, along and around by 25 degrees.";
  const procedural::Placement placement = plan.things[0].object.placement;
  const Motion along = plan.things[0].motion, around = turned(DVec3(placement.position), {0, 1, 0}, 25 * degree);
  plan.things[0].motion = [=](DVec3 point) { return along(around(point)); };
  const auto on_chair = [&](float x, float height, float z) { return DVec3(placement.world(at(x, height, z))); };
  plan.grips = {{on_chair(-0.15f, 0.475f, -0.15f), 0.62},
                {on_chair(0.15f, 0.475f, -0.15f), 0.62},
                {on_chair(0, 0.84f, 0.2f), 0.62}};
  return plan;
}

Plan teddy_on_sofa() {
  const DVec3 foot = dat(-0.3, 0, 0.02), shift = dat(0.66, 0, -0.03);
  const auto shaggy = [](Vec3 color, const SurfacePoint& p) {
    return Finish{color * (1 + 0.2f * procedural::fractal_noise(22.0f * p.local, 3)), 0};
  };
  const Vec3 fur = srgb(146, 100, 62), light = srgb(214, 182, 138), dark = srgb(32, 26, 24);
  const Material belly = [=](const SurfacePoint& p) {
    const bool front = p.local.z < 0 && std::hypot(p.local.x / 0.11f, (p.local.y + 0.18f) / 0.13f) < 1;
    return shaggy(front ? light : fur, p);
  };
  Object teddy{"teddy", {Vec3(foot), 0.15f}, {ellipsoid(at(0, 0.19f, 0), {0.17f, 0.2f, 0.15f}, belly)}};
  const auto add = [&](Vec3 middle, Vec3 half_axes, Vec3 color) {
    teddy.patches.push_back(ellipsoid(middle, half_axes, [=](const SurfacePoint& p) { return shaggy(color, p); }));
  };
  add(at(0, 0.47f, -0.01f), {0.145f, 0.135f, 0.135f}, fur);    // head
  add(at(0, 0.43f, -0.125f), {0.062f, 0.05f, 0.05f}, light);   // snout
  add(at(0, 0.45f, -0.172f), {0.022f, 0.016f, 0.012f}, dark);  // nose
  for (const float x : {-1.0f, 1.0f}) {
    add(at(x * 0.115f, 0.575f, 0), {0.055f, 0.06f, 0.03f}, fur);          // ear
    add(at(x * 0.055f, 0.505f, -0.128f), {0.017f, 0.02f, 0.012f}, dark);  // eye
    add(at(x * 0.185f, 0.25f, -0.06f), {0.058f, 0.12f, 0.06f}, fur);      // arm
    add(at(x * 0.12f, 0.065f, -0.2f), {0.068f, 0.065f, 0.12f}, fur);      // leg
    add(at(x * 0.12f, 0.075f, -0.315f), {0.05f, 0.05f, 0.016f}, light);   // sole
  }
  const Material ticking = [](const SurfacePoint& p) {
    const bool stripe = std::abs(std::sin(21 * p.local.x)) < 0.2f;
    return Finish{(stripe ? srgb(88, 108, 140) : srgb(206, 200, 184)) *
                      (1 + 0.06f * procedural::fractal_noise(9.0f * p.local, 2)),
                  0};
  };
  Plan plan{.what = "A teddy bear of many parts moved along a sofa with stripes.", .is_test = true};
  plan.surroundings = {procedural::make_room(-0.6f),
                       {"sofa", {}, box(at(0, -0.6f, 0), {2.6f, 0.6f, 1.2f}, ticking, 1)},
                       procedural::make_framed_print({at(0.5f, 1.2f, 1.40f), 0}, 1.4f, 1.0f)};
  append(plan.surroundings[1].patches, box(at(0, -0.6f, 0.7f), {2.6f, 1.4f, 0.22f}, ticking, 1));
  plan.things = {{teddy, shifted(shift)}};
  plan.orbit = {.target = dat(0, 0.25, 0), .distance = 3.0, .lowest = 10, .highest = 36};
  const auto on_teddy = [&](float x, float height, float z) { return DVec3(teddy.placement.world(at(x, height, z))); };
  plan.grips = {{on_teddy(0, 0.3f, -0.13f), 0.42}};
  plan.region = standing_on(0, foot, {0.62, 0.7, 0.72});
  plan.clicks = {{on_teddy(0.02f, 0.2f, -0.15f), on_teddy(-0.06f, 0.54f, -0.1f), on_teddy(-0.12f, 0.07f, -0.3f)},
                 {on_teddy(0, 0, -0.5f), on_teddy(0.5f, 0, -0.1f), on_teddy(0.1f, 0.75f, 0.45f)}};
  return plan;
}

Plan lamp_on_table() {
  const DVec3 foot = dat(-0.35, 0, -0.2), shift = dat(0.7, 0, -0.06);
  const Material shade = [](const SurfacePoint& p) {
    const float pleat = std::sin(40 * std::atan2(p.local.z, p.local.x));
    return Finish{srgb(226, 204, 156) * (1 + 0.06f * pleat), 0};
  };
  const Material brass = plain(srgb(150, 116, 58));
  Object lamp{"lamp",
              {Vec3(foot), 0},
              {lathe({{0.15f, 0}, {0.15f, 0.025f}, {0.05f, 0.05f}, {0.022f, 0.08f}, {0.022f, 0.5f}, {0, 0.5f}}, brass,
                     on_things, 32),
               lathe({{0.25f, 0.42f}, {0.14f, 0.72f}}, shade, on_things, 40)}};
  lamp.patches[1].two_sided = true;
  Plan plan{.what = "A lamp moved along a table: a shade on a thin stem on a foot.", .is_test = true};
  plan.surroundings = evaluate::furnished_room();
  plan.surroundings.push_back(
      procedural::make_book({at(0.9f, 0, 0.35f), -0.3f}, {0.6f, 0.12f, 0.45f}, srgb(122, 44, 52)));
  plan.things = {{lamp, shifted(shift)}};
  plan.glossy = {"lamp"};
  plan.orbit = {.target = dat(0, 0.3, -0.1), .distance = 3.4, .lowest = 12, .highest = 38};
  plan.grips = {{foot + dat(0, 0.55, -0.2), 0.6}};
  plan.region = standing_on(0, foot, {0.6, 0.8, 0.6});
  plan.clicks = {{foot + dat(0.02, 0.55, -0.2), foot + dat(0, 0.25, -0.022), foot + dat(0, 0.03, -0.12)},
                 {foot + dat(0, 0, -0.4), foot + dat(0.4, 0, 0), dat(-0.3, 1.0, 1.4)}};
  return plan;
}

Plan lamp_led_by_two() {
  Plan plan = lamp_on_table();
  plan.what = "The lamp on the table, led by two handles: its shade and its foot.";
  const DVec3 foot(plan.things[0].object.placement.position);
  plan.grips = {{foot + dat(0, 0.55, -0.2), 0.6}, {foot + dat(0.05, 0.03, -0.12), 0.6}};
  return plan;
}

}  // namespace engine::captures
