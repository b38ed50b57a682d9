// What captured cases are made from: things, how they move, where cameras stand, what a person would ask for.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "engine/captures/orbit.h"
#include "engine/captures/surfels_in_motion.h"
#include "engine/core/vec.h"
#include "engine/edit/request.h"
#include "engine/procedural/surface.h"

namespace engine::captures {

/// A thing that the edit is to move.
struct Thing {
  procedural::Object object;
  Motion motion;     ///< From where it is before the edit to where it should be.
  Motion pose = {};  ///< From where its formula has it to where it is before the edit; empty: it is there.
};

/// A handle as a person means it. The person points at a surface: where the camera of "photo_00" sees `near`.
struct Grip {
  DVec3 near{0.0};        ///< World units.
  double radius = 0;      ///< World units.
  std::size_t thing = 0;  ///< The thing it is on, whose motion says where it goes.
  bool anchor = false;    ///< It stays.
};

/// What a person would click at to say what moves: places near the surfaces meant. At most six in all.
struct ClickPlan {
  std::vector<DVec3> inside, outside;  ///< World units.
};

/// How badly something is selected.
struct Carelessness {
  double beyond_px = 5;        ///< Pixels of a photo that the selection reaches beyond the outline.
  double missing_share = 0.5;  ///< Of the thing that it leaves out, 0 to 1.
};

/// A captured case before anything is made of it.
struct Plan {
  std::string what;       ///< One sentence for people.
  std::string said = {};  ///< What handles cannot say exactly, and what they say instead; empty: they can.
  bool is_test = false;   ///< See CapturedCase.
  bool textured = true;   ///< See evaluate::Case.
  std::vector<procedural::Object> surroundings = {};
  std::vector<Thing> things = {};
  /// Places of the surroundings that belong to what a person means to move, although the truth has them stay: what an
  /// `extend` draws out. Empty: none.
  std::function<bool(DVec3)> drawn_from = {};
  std::vector<procedural::Object> only_after = {};  ///< Things that only the edited scene has.
  bool casts_shadows = false;  ///< Things darken their surroundings where they are, before and after; else nowhere.
  std::vector<std::string> glossy = {};  ///< Names of objects that gleam.
  Orbit orbit = {};
  edit::Mode mode = edit::Mode::move;
  std::vector<Grip> grips = {};
  std::optional<edit::Region> region = {};
  ClickPlan clicks = {};
  std::optional<Carelessness> careless = {};
};

/// A plan by its name.
struct NamedPlan {
  std::string name;
  Plan (*make)();
};

/// All of them, in order.
[[nodiscard]] const std::vector<NamedPlan>& known_plans();

}  // namespace engine::captures
