#include "engine/procedural/demo_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <numeric>
#include <utility>

#include "engine/procedural/materials.h"
#include "engine/procedural/objects.h"
#include "engine/procedural/surfels.h"

namespace engine::procedural {
namespace {

constexpr float ball_radius = 0.21f;
constexpr Vec3 ball_foot(-0.28f, 0, -0.62f), ball_goes_to(0.52f, 0, -0.70f);

Light afternoon() {
  Light light;
  light.to_sun = glm::normalize(Vec3(-0.80f, -0.66f, -0.62f));
  light.sun = 4.2f * Vec3(1.0f, 0.83f, 0.60f);
  light.sun_radius_rad = 0.03f;
  light.sky_up = 0.80f * Vec3(0.80f, 0.90f, 1.0f);
  light.sky_level = 0.62f * Vec3(0.92f, 0.95f, 1.0f);
  light.sky_down = 0.30f * Vec3(1.0f, 0.85f, 0.70f);
  light.window = {.middle = {0.25f, -0.75f, 0.0f},
                  .columns = 4,
                  .rows = 3,
                  .pane_width = 0.92f,
                  .pane_height = 0.98f,
                  .bar = 0.09f,
                  .softness = 0.035f};
  return light;
}

/// Four spheres along the midrib of the leaf that reaches farthest towards the books: its stalk end is held, the others
/// swing up, the tip farthest.
SuggestedDrag bend_leaf(const Plant& plant) {
  const Blade* blade = &plant.blades.front();
  auto tip = [&](const Blade& b) { return plant.object.placement.world(b.midrib(1)); };
  for (const Blade& other : plant.blades)
    if (tip(other).x > tip(*blade).x) blade = &other;
  SuggestedDrag drag{"leaf", "move", {}};
  const DVec3 lift(0.02, -0.42, -0.04);
  for (const float v : {0.04f, 0.36f, 0.66f, 0.92f}) {
    const DVec3 source(plant.object.placement.world(blade->midrib(v)));
    SuggestedDrag::Handle handle{source, std::nullopt, 0.9 * double(blade->half_width)};
    if (v > 0.1f) handle.target = source + double(v * v) * lift;
    drag.handles.push_back(handle);
  }
  return drag;
}

}  // namespace

Result<void> validate(const DemoOptions& options) {
  auto bad = [](const char* option, const std::string& expected, auto found) {
    return fail(ErrorCode::invalid_argument,
                std::string(option) + ": expected " + expected + ", found " + std::to_string(found), option);
  };
  if (options.gaussians < 2'000 || options.gaussians > 5'000'000)
    return bad("gaussians", "2000 to 5000000", options.gaussians);
  if (options.views < 1 || options.views > 1000) return bad("views", "1 to 1000", options.views);
  if (options.width < 16 || options.width > 16384) return bad("width", "16 to 16384 pixels", options.width);
  if (options.height < 16 || options.height > 16384) return bad("height", "16 to 16384 pixels", options.height);
  const double shift = glm::length(options.ball_shift);
  if (!(shift <= max_ball_shift)) return bad("ball-shift", "three numbers, together no longer than 100", shift);  // NaN
  return {};
}

StillLife make_still_life(std::uint64_t seed) {
  const Placement pot{{-0.62f, 0, 0.28f}, 0.3f};
  Plant plant = make_plant(pot, 34, seed);
  StillLife scene;
  scene.light = afternoon();
  scene.drags.push_back({"ball",
                         "move",
                         {{DVec3(ball_foot) - DVec3(0, double(ball_radius), 0),
                           DVec3(ball_goes_to) - DVec3(0, double(ball_radius), 0), 1.04 * double(ball_radius)}}});
  scene.drags.push_back(bend_leaf(plant));

  const float thick = 0.15f;
  scene.objects = {make_room(-1.5f),
                   make_table({}, {3.7f, 1.5f, 2.1f}),
                   make_framed_print({{1.35f, -1.55f, 1.415f}, 0}, 1.15f, 0.85f),
                   make_pot(pot),
                   std::move(plant.object),
                   make_book({{0.86f, 0, 0.22f}, 0.12f}, {0.98f, thick, 0.68f}, srgb(46, 78, 86)),
                   make_book({{0.90f, -thick, 0.24f}, -0.10f}, {0.88f, 0.12f, 0.62f}, srgb(168, 62, 48)),
                   make_book({{0.84f, -thick - 0.12f, 0.23f}, 0.26f}, {0.78f, 0.10f, 0.56f}, srgb(222, 178, 92)),
                   make_apple({{0.82f, -thick - 0.22f, 0.20f}, 0.5f}, 0.155f),
                   make_apple({{-1.22f, 0, -0.42f}, 2.6f}, 0.16f),
                   make_mug({{1.30f, 0, -0.42f}, 0.5f}),
                   make_ball({ball_foot, 0}, ball_radius, srgb(240, 232, 214), srgb(38, 84, 124))};
  return scene;
}

std::vector<scene::Camera> make_arc_cameras(int count, int width, int height) {
  constexpr double degree = std::numbers::pi / 180, fov_y = 40 * degree, distance = 4.5;
  const DVec3 target(0.05, -0.52, 0.0), up(0, -1, 0);
  std::vector<scene::Camera> cameras;
  for (int i = 0; i < count; ++i) {
    // Roberts' additive sequence for two dimensions: 1 / p and 1 / p^2 with p^3 = p + 1. It starts in the middle.
    const double around = std::fmod(0.5 + 0.7548776662466927 * i, 1.0);
    const double above = std::fmod(0.36 + 0.5698402909980532 * i, 1.0);
    const double azimuth = (2 * around - 1) * 52 * degree, elevation = (10 + 34 * above) * degree;
    const DVec3 direction(std::sin(azimuth) * std::cos(elevation), -std::sin(elevation),
                          -std::cos(azimuth) * std::cos(elevation));
    cameras.push_back(scene::look_at(target + distance * direction, target, up, fov_y, width, height));
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "view_%02d", i);
    cameras.back().name = name.data();
  }
  return cameras;
}

namespace {

/// The still life closed all over, lit by its objects where `shading` has them.
Surfels closed_all_over(const StillLife& still_life, std::span<const Object> shading,
                        std::span<const scene::Camera> cameras, const DemoOptions& options) {
  Surfels surfels =
      make_surfels(still_life.objects, still_life.light, cameras, options.gaussians, options.seed, shading);
  const Surfels unseen = make_unseen_surfels(surfels, still_life.objects, still_life.light, cameras, options.gaussians,
                                             options.seed, shading);
  std::vector<std::uint32_t> all(unseen.cloud.size());
  std::iota(all.begin(), all.end(), 0u);
  scene::append_rows(surfels.cloud, unseen.cloud, all);
  surfels.object.insert(surfels.object.end(), unseen.object.begin(), unseen.object.end());
  return surfels;
}

/// The true result of dragging the ball, the last object.
Surfels with_ball_carried(const StillLife& still_life, std::span<const scene::Camera> cameras,
                          const DemoOptions& options) {
  std::vector<Object> shading = still_life.objects;
  shading.back().placement.position += Vec3(options.ball_shift);
  const Surfels as_it_was = closed_all_over(still_life, {}, cameras, options);
  Surfels surfels = closed_all_over(still_life, shading, cameras, options);
  for (std::size_t row = 0; row < surfels.cloud.size(); ++row) {
    if (surfels.object[row] != still_life.objects.size() - 1) continue;
    surfels.cloud.mean.set(row, Vec3(DVec3(surfels.cloud.mean.get(row)) + options.ball_shift));
    std::ranges::copy(as_it_was.cloud.sh_row(row), surfels.cloud.sh_row(row).begin());
  }
  return surfels;
}

}  // namespace

DemoScene make_demo_scene(const DemoOptions& options) {
  StillLife still_life = make_still_life(options.seed);
  DemoScene demo;
  demo.cameras = make_arc_cameras(options.views, options.width, options.height);
  Surfels surfels = options.ball_shift == DVec3(0.0) ? make_surfels(still_life.objects, still_life.light, demo.cameras,
                                                                    options.gaussians, options.seed)
                                                     : with_ball_carried(still_life, demo.cameras, options);
  demo.cloud = std::move(surfels.cloud);
  demo.object = std::move(surfels.object);
  for (const Object& object : still_life.objects) demo.object_names.push_back(object.name);
  demo.drags = std::move(still_life.drags);
  if (options.ball_shift != DVec3(0.0)) {
    SuggestedDrag::Handle& ball = demo.drags.front().handles.front();  // from where it stands now, back to its place
    ball.target = ball.source;
    ball.source += options.ball_shift;
  }
  return demo;
}

}  // namespace engine::procedural
