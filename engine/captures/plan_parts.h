// What plans share.
#pragma once

#include <numbers>
#include <utility>
#include <vector>

#include "engine/captures/plan.h"
#include "engine/core/vec.h"
#include "engine/procedural/surface.h"

namespace engine::captures {

constexpr double degree = std::numbers::pi / 180;
constexpr float on_things = 2.2f;  ///< Gaussians per area, relative to the table top.

/// A place at a height; the world's y points down.
[[nodiscard]] constexpr Vec3 at(float x, float height, float z) { return {x, -height, z}; }
[[nodiscard]] constexpr DVec3 dat(double x, double height, double z) { return {x, -height, z}; }

inline void append(std::vector<procedural::Patch>& to, std::vector<procedural::Patch> more) {
  for (procedural::Patch& patch : more) to.push_back(std::move(patch));
}

/// Cubes of two colours.
[[nodiscard]] procedural::Material checks(Vec3 one, Vec3 other, float side);

[[nodiscard]] inline Motion shifted(DVec3 shift) {
  return [=](DVec3 point) { return point + shift; };
}
/// About an axis through the pivot.
[[nodiscard]] inline Motion turned(DVec3 pivot, DVec3 axis, double angle) {
  const DQuat turn = glm::angleAxis(angle, axis);
  return [=](DVec3 point) { return pivot + turn * (point - pivot); };
}

/// A box as a person draws one around a thing that stands on something: its floor is 0.02 above the support, so that
/// it holds nothing of the support.
[[nodiscard]] inline edit::Region standing_on(double support_height, DVec3 middle, DVec3 size) {
  constexpr double clear = 0.02;
  return {{middle.x, -(support_height + clear + 0.5 * size.y), middle.z}, size};
}

// Plans of things that bend, in plans_that_bend.cc.
[[nodiscard]] Plan bent_plant();
[[nodiscard]] Plan opened_mouth();
[[nodiscard]] Plan opened_mouth_carelessly();

// Plans of things of several parts, in plans_of_homes.cc.
[[nodiscard]] Plan can_on_floor();
[[nodiscard]] Plan vase_on_tiles();
[[nodiscard]] Plan chair_on_carpet();
[[nodiscard]] Plan chair_led_by_three();
[[nodiscard]] Plan teddy_on_sofa();
[[nodiscard]] Plan lamp_on_table();
[[nodiscard]] Plan lamp_led_by_two();

// Plans of things that turn on hinges, in plans_of_hinges.cc.
[[nodiscard]] Plan lid_opened();
[[nodiscard]] Plan door_opened();
[[nodiscard]] Plan laptop_opened();

}  // namespace engine::captures
