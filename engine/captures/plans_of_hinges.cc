// Parts of things that turn about an edge. Two handles are where a hand would take them, an anchor is near the hinge,
// as near as people care to put it. Figures are world units, and part of the definition of the cases.
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
using procedural::Finish;
using procedural::Material;
using procedural::Object;
using procedural::Patch;
using procedural::plain;
using procedural::quad;
using procedural::srgb;
using procedural::SurfacePoint;
using procedural::wood;

/// A chest without its lid, of thin boards that are seen from both sides.
Object chest(Vec3 foot, Vec3 size) {
  const Material boards = wood(srgb(150, 104, 66), srgb(92, 58, 36), 0.11f);
  const Vec3 x(size.x, 0, 0), up(0, -size.y, 0), z(0, 0, size.z);
  const Vec3 a(-0.5f * size.x, 0, -0.5f * size.z);
  Object out{
      "chest",
      {foot, 0},
      {quad(a, x, up, boards, on_things), quad(a + z, up, x, boards, on_things), quad(a, up, z, boards, on_things),
       quad(a + x, z, up, boards, on_things), quad(a + 0.02f * up, x, z, boards, on_things)}};
  for (Patch& patch : out.patches) patch.two_sided = true;
  return out;
}

/// A cupboard without its door, open to the front, with a shelf: boards that are seen from both sides.
Object cupboard(Vec3 foot, Vec3 size) {
  const Material paint = plain(srgb(222, 218, 206)), inside = wood(srgb(188, 160, 122), srgb(150, 122, 88), 0.15f);
  const Vec3 x(size.x, 0, 0), up(0, -size.y, 0), z(0, 0, size.z);
  const Vec3 a(-0.5f * size.x, 0, -0.5f * size.z);
  Object out{"cupboard",
             {foot, 0},
             {quad(a, up, z, paint, on_things), quad(a + x, z, up, paint, on_things),
              quad(a + up, x, z, paint, on_things), quad(a + z, up, x, inside, on_things),
              quad(a + 0.5f * up, x, z, inside, on_things), quad(a + 0.03f * up, x, z, inside, on_things)}};
  for (Patch& patch : out.patches) patch.two_sided = true;
  return out;
}

}  // namespace

Plan lid_opened() {
  const Vec3 size(0.74f, 0.3f, 0.46f);
  const DVec3 foot = dat(0.05, 0, -0.25), hinge = foot + dat(0, double(size.y), 0.5 * double(size.z));
  const double front = -double(size.z);
  Plan plan{.what = "The lid of a chest opened by 55 degrees; nobody has seen the inside before.", .is_test = true};
  plan.surroundings = evaluate::furnished_room();
  plan.surroundings.push_back(chest(Vec3(foot), size));
  plan.things = {{{"lid",
                   {Vec3(foot) + at(0, size.y, 0), 0},
                   box({0, 0, 0}, {size.x + 0.03f, 0.06f, size.z + 0.03f},
                       checks(srgb(196, 160, 96), srgb(120, 44, 40), 0.12f), on_things)},
                  turned(hinge, {1, 0, 0}, -55 * degree)}};
  plan.orbit = {.target = dat(0.05, 0.25, -0.2), .distance = 3.2, .lowest = 14, .highest = 40};
  const double half = 0.5 * double(size.x);
  plan.grips = {{hinge + dat(-0.75 * half, 0.06, front + 0.06), 0.42},
                {hinge + dat(0.75 * half, 0.06, front + 0.06), 0.42},
                {hinge + dat(0, 0.06, -0.03), 0.16, 0, true}};
  plan.region = edit::Region{foot + dat(0, double(size.y) + 0.04, 0), {0.86, 0.08, 0.56}};
  plan.clicks = {
      {hinge + dat(-0.2, 0.06, 0.5 * front), hinge + dat(0.25, 0.06, 0.7 * front), hinge + dat(0, 0.03, front - 0.015)},
      {foot + dat(0, 0.15, 0.5 * front), foot + dat(0.5, 0, -0.2), hinge + dat(0, 0.4, 1.4)}};
  return plan;
}

Plan door_opened() {
  const Vec3 size(0.56f, 0.7f, 0.36f);
  constexpr float thick = 0.035f;
  const DVec3 foot = dat(-0.05, 0, 0.1);
  const double half = 0.5 * double(size.x), front = -0.5 * double(size.z);
  const DVec3 hinge = foot + dat(-half, 0, front);
  const Material panel = [=](const SurfacePoint& p) {
    const float x = std::abs(p.local.x) / 0.5f, y = std::abs(p.local.y + 0.5f * size.y) / 0.5f;
    const bool knob = std::hypot(p.local.x - 0.22f, p.local.y + 0.38f) < 0.025f;
    const bool groove = std::abs(x - 0.36f) < 0.02f && y < 0.52f;
    const bool across = std::abs(y - 0.5f) < 0.02f && x < 0.38f;
    const bool leaf = std::sin(31 * p.local.x) * std::sin(23 * p.local.y) > 0.55f && x < 0.3f && y < 0.44f;
    const Vec3 color = knob               ? srgb(60, 48, 40)
                       : groove || across ? srgb(32, 76, 78)
                       : leaf             ? srgb(226, 190, 120)
                                          : srgb(64, 124, 122);
    return Finish{color * (1 + 0.1f * procedural::fractal_noise(9.0f * p.local, 2)), 0};
  };
  Plan plan{.what = "The door of a cupboard opened by 60 degrees; nobody has seen the inside before."};
  plan.surroundings = {
      procedural::make_room(-0.03f),
      {"floor",
       {},
       {quad(at(-2.2f, 0, -1.4f), {4.4f, 0, 0}, {0, 0, 2.6f}, wood(srgb(176, 134, 92), srgb(118, 82, 52), 0.16f), 1)}},
      cupboard(Vec3(foot), size),
      procedural::make_framed_print({at(0.8f, 1.1f, 1.20f), 0}, 0.9f, 0.7f),
      procedural::make_mug({Vec3(foot) + at(0.1f, size.y, 0), 0.4f})};
  plan.things = {{{"door",
                   {Vec3(foot) + at(0, 0.02f, float(front) - 0.5f * thick), 0},
                   box({0, 0, 0}, {size.x, size.y - 0.02f, thick}, panel, on_things)},
                  turned(hinge, {0, 1, 0}, 60 * degree)}};
  plan.orbit = {.target = dat(0, 0.4, 0), .distance = 3.3, .lowest = 8, .highest = 32};
  const double skin = front - double(thick), middle = 0.5 * double(size.y);
  plan.grips = {{foot + dat(0.85 * half, 0.85 * double(size.y), skin), 0.4},
                {foot + dat(0.85 * half, 0.2 * double(size.y), skin), 0.4},
                {foot + dat(-0.88 * half, middle, skin), 0.2, 0, true}};
  plan.region = edit::Region{foot + dat(0, middle, front - 0.5 * double(thick)), {0.6, 0.72, 0.07}};
  plan.clicks = {{foot + dat(-0.1, 0.5, skin), foot + dat(0.2, 0.15, skin), foot + dat(-0.2, 0.1, skin)},
                 {foot + dat(half + 0.3, 0, -0.2), foot + dat(0, double(size.y), 0.1), foot + dat(0, 0, -0.5)}};
  return plan;
}

Plan laptop_opened() {
  const DVec3 foot = dat(0, 0, -0.15), hinge = foot + dat(0, 0.035, 0.22);
  constexpr double width = 0.7, depth = 0.46, tall = 0.44;
  const Material keys = [](const SurfacePoint& p) {
    const auto gap = [](float x) { return x - std::floor(x) < 0.16f; };
    const bool pad = std::abs(p.local.x) < 0.1f && p.local.z < -0.1f;
    const bool keyboard = std::abs(p.local.x) < 0.31f && p.local.z > -0.07f && p.local.z < 0.17f;
    if (pad) return Finish{srgb(150, 152, 158), 0};
    if (keyboard && !gap(p.local.x / 0.048f) && !gap(p.local.z / 0.048f)) return Finish{srgb(38, 40, 46), 0};
    return Finish{srgb(186, 188, 194), 0};
  };
  const Material screen = [](const SurfacePoint& p) {
    const float x = p.local.x, y = -p.local.y;
    if (std::abs(x) > 0.32f || y < 0.04f || y > 0.41f) return Finish{srgb(30, 30, 34), 0};
    if (y < 0.075f) return Finish{std::sin(60 * x) > 0.4f ? srgb(220, 220, 226) : srgb(44, 50, 70), 0};
    const bool sun = std::hypot(x - 0.12f, y - 0.3f) < 0.05f;
    const bool hill = y < 0.17f + 0.04f * std::sin(11 * x) + 0.02f * std::sin(29 * x);
    return Finish{sun ? srgb(250, 226, 150) : hill ? srgb(46, 92, 84) : srgb(120 + int(250 * y), 130, 190), 0};
  };
  const DVec3 across(1, 0, 0);
  const Motion before = turned(hinge, across, 8 * degree);
  Plan plan{.what = "The screen of a laptop laid back from 82 to 125 degrees.", .is_test = true};
  plan.surroundings = evaluate::furnished_room();
  plan.surroundings.push_back(
      {"keyboard", {Vec3(foot), 0}, box({0, 0, 0}, {float(width), 0.03f, float(depth)}, keys, on_things)});
  plan.things = {{{"screen", {Vec3(hinge), 0}, box({0, 0, 0}, {float(width), float(tall), 0.022f}, screen, on_things)},
                  turned(hinge, across, -43 * degree),
                  before}};
  plan.orbit = {.target = dat(0, 0.2, -0.05), .distance = 3.0, .lowest = 8, .highest = 34};
  const auto on_screen = [&](double x, double height) { return before(hinge + dat(x, height, -0.011)); };
  plan.grips = {{on_screen(-0.3, tall - 0.03), 0.34},
                {on_screen(0.28, tall - 0.04), 0.34},
                {on_screen(0.02, 0.03), 0.16, 0, true}};
  plan.region = edit::Region{hinge + dat(0, 0.5 * tall + 0.01, -0.02), {width + 0.06, tall, 0.14}};
  plan.clicks = {{on_screen(0, 0.22), on_screen(-0.2, 0.35), on_screen(0.335, 0.2)},
                 {foot + dat(0, 0.03, -0.15), foot + dat(0.6, 0, 0), dat(-0.6, 1.0, 1.4)}};
  return plan;
}

}  // namespace engine::captures
