// Things that change their shape. Figures are world units, and part of the definition of the cases.
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

using procedural::srgb;

constexpr std::uint64_t plant_seed = 11;  // of how its leaves grow

float smoothstep(float low, float high, float x) {
  const float t = std::clamp((x - low) / (high - low), 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}

// The face: the front of an ellipsoid, in angles around it. Angles in radians; lengths relative to the half-axes.
constexpr float half_width = 0.40f, half_height = 0.54f, half_depth = 0.40f;
constexpr float lowest = -1.30f, mouth_line = -0.40f, highest = 1.30f, side = 1.45f;

/// Point of the face, relative to its middle.
///   across, up  angles from straight ahead
///   depth       1 on the skin, less behind it
Vec3 face_point(float across, float up, float depth) {
  const float nose = 0.20f * std::exp(-(across * across / 0.02f + (up + 0.02f) * (up + 0.02f) / 0.05f));
  const float r = depth * (1 + nose);
  return at(r * half_width * std::sin(across) * std::cos(up), depth * half_height * std::sin(up),
            -r * half_depth * std::cos(across) * std::cos(up));
}

procedural::Finish skin(float across, float up) {
  const Vec3 place(3 * across, 3 * up, 0);
  Vec3 color = srgb(214, 160, 126) * (1 + 0.10f * procedural::fractal_noise(2.0f * place, 4));
  const auto paint = [&](Vec3 over, float share) { color += std::clamp(share, 0.0f, 1.0f) * (over - color); };
  for (const float eye : {-0.42f, 0.42f}) {
    const float x = (across - eye) / 0.17f, y = (up - 0.30f) / 0.085f, r = std::hypot(x, y);
    paint(srgb(244, 240, 232), 1 - smoothstep(0.92f, 1.08f, r));
    const float iris = std::hypot(across - eye, up - 0.30f);
    paint(srgb(60, 90, 70), 1 - smoothstep(0.062f, 0.078f, iris));
    paint(srgb(20, 18, 18), 1 - smoothstep(0.028f, 0.042f, iris));
    const float brow = std::abs(up - 0.50f + 0.6f * (across - eye) * (across - eye));
    paint(srgb(70, 46, 34),
          (1 - smoothstep(0.03f, 0.05f, brow)) * (1 - smoothstep(0.18f, 0.22f, std::abs(across - eye))));
    const float cheek = std::hypot((across - 1.3f * eye) / 0.3f, (up + 0.12f) / 0.2f);
    paint(srgb(214, 120, 104), 0.45f * (1 - smoothstep(0.3f, 1.0f, cheek)));
  }
  const float lip =
      std::abs(up - mouth_line) / (0.085f * (1 - std::pow(std::min(1.0f, std::abs(across) / 0.46f), 2.0f)) + 1e-3f);
  paint(srgb(168, 62, 64), 1 - smoothstep(0.85f, 1.05f, lip));
  const float hair = up + 0.15f * std::sin(9 * across) - 0.80f + 0.35f * smoothstep(0.8f, 1.3f, std::abs(across));
  paint(srgb(64, 44, 34) * (1 + 0.5f * procedural::noise(Vec3(30 * across, 6 * up, 0))),
        smoothstep(-0.03f, 0.03f, hair));
  return {color, 0};
}

/// The skin between two angles.
procedural::Patch face(float from, float to) {
  const auto across = [](float u) { return (2 * u - 1) * side; };
  return {.position = [=](float u, float v) { return face_point(across(u), std::lerp(from, to, v), 1); },
          .material = [=](const procedural::SurfacePoint& p) { return skin(across(p.u), std::lerp(from, to, p.v)); },
          .cells_u = 40,
          .cells_v = 20,
          .density = on_things,
          .two_sided = true};
}

/// What is behind the lips: teeth above, the dark below.
procedural::Patch mouth_inside() {
  constexpr float low = -0.85f, high = -0.28f, wide = 0.62f;
  const auto across = [](float u) { return (2 * u - 1) * wide; };
  return {.position = [=](float u, float v) { return face_point(across(u), std::lerp(low, high, v), 0.88f); },
          .material =
              [=](const procedural::SurfacePoint& p) {
                const float up = std::lerp(low, high, p.v), tooth = 14 * p.u - std::floor(14 * p.u);
                const bool teeth = up > mouth_line - 0.24f;
                const Vec3 color = teeth ? srgb(238, 232, 214) * (tooth < 0.12f ? 0.5f : 1.0f) : srgb(70, 18, 22);
                return procedural::Finish{color, 0};
              },
          .cells_u = 20,
          .cells_v = 10,
          .density = on_things,
          .two_sided = true};
}

}  // namespace

Plan bent_plant() {
  const DVec3 foot = dat(-0.1, 0, -0.1), soil = foot + dat(0, double(procedural::soil_height), 0);
  const double tall = 0.9, angle = 34 * degree;
  // Each height turns about the soil by its own angle: nothing at the soil, all of it at the top.
  const Motion bend = [=](DVec3 point) {
    const double t = std::clamp((soil.y - point.y) / tall, 0.0, 1.0);
    return soil + glm::angleAxis(angle * t * t * (3 - 2 * t), DVec3(0, 0, 1)) * (point - soil);
  };
  Plan plan{.what = "A leafy plant bent to the right, by two handles.", .textured = false};
  plan.surroundings = {procedural::make_room(-1.5f), procedural::make_table({}, {3.7f, 1.5f, 2.1f}),
                       procedural::make_framed_print({at(-0.9f, 1.0f, 1.40f), 0}, 1.5f, 1.1f),
                       procedural::make_pot({Vec3(foot), 0.3f})};
  plan.things = {{procedural::make_plant({Vec3(foot), 0.3f}, 22, plant_seed).object, bend}};
  plan.orbit = {.target = dat(0.05, 0.65, -0.1), .distance = 3.8};
  plan.grips = {{soil + dat(0, 0.3, -0.1), 0.6}, {soil + dat(0, 0.75, 0), 0.65}};
  plan.region = standing_on(double(procedural::soil_height) + 0.04, foot, {2.0, 1.5, 2.0});
  plan.clicks = {{soil + dat(0.05, 0.35, -0.2), soil + dat(-0.2, 0.4, -0.1), soil + dat(0.1, 0.75, 0)},
                 {foot + dat(0, 0.3, -0.4), foot + dat(0.6, 0, -0.3), dat(-1.0, 1.2, 1.4)}};
  return plan;
}

Plan opened_mouth() {
  constexpr double open = 0.15, wide = 0.30;
  const DVec3 middle = dat(0, 0.72, -0.1);
  const double line = double(half_height * std::sin(mouth_line)), chin = double(-half_height);
  // The jaw sinks by `open` at the lip and by 0.6 of it at the chin, in the middle; towards the sides not at all.
  const Motion sink = [=](DVec3 point) {
    const double x = std::clamp(std::abs(point.x - middle.x) / wide, 0.0, 1.0);
    const double down = std::clamp((line - (middle.y - point.y)) / (line - chin), 0.0, 1.0);
    const double fade = std::pow(std::cos(0.5 * std::numbers::pi * x), 2.0);
    return point + DVec3(0, open * fade * (1 - 0.4 * down), 0);
  };
  Plan plan{.what = "The mouth of a face opened: the lower lip and the chin sink, the rest stays."};
  plan.surroundings = evaluate::furnished_room();
  plan.surroundings.push_back({"neck",
                               {at(0, 0, 0.02f), 0},
                               {procedural::lathe({{0.30f, 0}, {0.24f, 0.06f}, {0.16f, 0.12f}, {0.15f, 0.5f}},
                                                  procedural::plain(srgb(96, 92, 88)), on_things, 40)}});
  // What stays of the face is a thing, too, that goes nowhere: one light for all of it.
  plan.things = {{{"jaw", {Vec3(middle), 0}, {face(lowest, mouth_line)}}, sink},
                 {{"face", {Vec3(middle), 0}, {face(mouth_line, highest), mouth_inside()}}, shifted(DVec3(0.0))}};
  plan.orbit = {.target = dat(0, 0.65, -0.2), .distance = 2.5, .reach = 36, .lowest = 4, .highest = 26};
  const auto on_face = [&](float across, float up) { return middle + DVec3(face_point(across, up, 1)); };
  plan.grips = {{on_face(0, mouth_line - 0.06f), 0.2},
                {on_face(0, mouth_line - 0.42f), 0.2},
                {on_face(0, mouth_line + 0.12f), 0.12, 0, true}};
  plan.clicks = {
      {on_face(0, mouth_line - 0.05f), on_face(-0.2f, mouth_line - 0.25f), on_face(0.15f, mouth_line - 0.4f)},
      {on_face(0, mouth_line + 0.06f), on_face(-0.75f, -0.3f), on_face(0.75f, -0.3f)}};
  return plan;
}

Plan opened_mouth_carelessly() {
  Plan plan = opened_mouth();
  plan.what = "The mouth of the face, selected badly.";
  plan.careless = Carelessness{};
  return plan;
}

}  // namespace engine::captures
