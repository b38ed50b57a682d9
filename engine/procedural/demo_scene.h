// The demo scene: a still life by a window. A plant in a painted pot, books, a mug, apples and a striped ball on a
// wooden table, before a plastered wall with a framed print.
// Frame: COLMAP's habit, x right, y down, z away from the first camera. The table top is the plane y = 0; one unit is
// about half a metre.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/procedural/light.h"
#include "engine/procedural/surface.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::procedural {

/// How far the ball may be carried, world units: out of the room, and not so far that single precision loses it. A
/// choice.
constexpr double max_ball_shift = 100;

/// What the demo scene is made of.
struct DemoOptions {
  std::size_t gaussians = 150'000;  ///< 2,000 to 5,000,000.
  std::uint64_t seed = 0;
  int views = 40;                 ///< 1 to 1000.
  int width = 640, height = 480;  ///< Pixels of a view, 16 to 16384.
  /// How far the ball has been carried from its place, world units. Otherwise than zero, the scene is the true result
  /// of dragging it there: its shadow goes along, the light on it stays as it was, and what no camera has seen is
  /// there, too. No longer than max_ball_shift.
  DVec3 ball_shift{0.0};
};
/// errors  invalid_argument: `where` is the option
[[nodiscard]] Result<void> validate(const DemoOptions& options);

/// A drag worth trying, in the terms of an edit request.
struct SuggestedDrag {
  struct Handle {
    DVec3 source{0.0};            ///< World units.
    std::optional<DVec3> target;  ///< Nothing: an anchor.
    double radius = 0;            ///< World units.
  };
  std::string name;  ///< "ball", "leaf"
  std::string mode;  ///< "move" or "extend"
  std::vector<Handle> handles;
};

/// The demo scene.
struct DemoScene {
  scene::GaussianCloud cloud;             ///< Of SH degree 1; only what some camera sees.
  std::vector<scene::Camera> cameras;     ///< "view_00" from the front, the others around it in an arc.
  std::vector<std::uint16_t> object;      ///< [N] index into object_names.
  std::vector<std::string> object_names;  ///< "table", "ball", ...
  std::vector<SuggestedDrag> drags;
};

/// Where things stand: change it and cover it with make_surfels() again to get a scene whose edited state is known.
struct StillLife {
  std::vector<Object> objects;
  Light light;
  std::vector<SuggestedDrag> drags;
};
[[nodiscard]] StillLife make_still_life(std::uint64_t seed);

/// Cameras on an arc around the table, looking at it from a little above. The first n of more cameras are spread as
/// evenly as n can be.
[[nodiscard]] std::vector<scene::Camera> make_arc_cameras(int count, int width, int height);

/// Precondition: validate(options) holds. The cloud's size is within 1 % of options.gaussians; with a ball_shift, what
/// no camera has seen comes on top, and the drag of the ball leads back to its place. Same options, same bytes, for any
/// number of threads.
[[nodiscard]] DemoScene make_demo_scene(const DemoOptions& options = {});

}  // namespace engine::procedural
