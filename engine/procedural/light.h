// Light that is baked into the colours: a low sun through a window, the light of the sky, one bounce.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/procedural/occluders.h"
#include "engine/procedural/surface.h"

namespace engine::procedural {

/// A paned window that the sun shines through, seen from the sun.
struct Window {
  Vec3 middle{0.0f};  ///< A point that the middle of the light falls on, world units.
  int columns = 3, rows = 2;
  float pane_width = 1, pane_height = 1, bar = 0.1f;  ///< World units.
  float softness = 0.04f;                             ///< Of the edges of the light, world units.
};

/// The light of a made-up scene.
struct Light {
  Vec3 to_sun{0, -1, 0};         ///< Unit.
  Vec3 sun{3.0f};                ///< Irradiance of a surface that faces it, linear.
  float sun_radius_rad = 0.02f;  ///< Of its disc: how soft shadows are.
  Vec3 sky_up{0.5f};             ///< Radiance from straight above, over pi.
  Vec3 sky_level{0.3f};          ///< From the horizon.
  Vec3 sky_down{0.1f};           ///< From below.
  Window window;

  /// How much of the sun the window lets through to a point, 0 to 1.
  [[nodiscard]] float through_window(Vec3 point) const;
  [[nodiscard]] Vec3 sky(Vec3 direction) const;  ///< Radiance over pi from a unit direction.
};

/// What falls on a patch, on a grid over u and v. Only the points that were asked for are ever computed.
struct LightMap {
  int width = 0, height = 0;
  bool closed_u = false;
  std::vector<Vec3> ambient;         ///< [height][width] irradiance over pi of sky and bounce.
  std::vector<float> sun;            ///< [height][width] part of the sun's disc that is not hidden by things.
  std::vector<std::uint8_t> wanted;  ///< [height][width]

  struct Sample {
    Vec3 ambient{0.0f};
    float sun = 0;
  };
  void want(float u, float v);                      ///< at(u, v) will be asked for.
  [[nodiscard]] Sample at(float u, float v) const;  ///< Bilinear.
};

/// Empty maps, one per patch, counted over all objects in order.
///   texel  distance of grid points on a patch of density 1 or more, world units; wider where the density is less
[[nodiscard]] std::vector<LightMap> make_light_maps(std::span<const Object> objects, float texel);
/// Fills them in where wanted.
///   shading    the objects that cast shadows and send light back
///   occluders  of those
void bake(std::span<const Object> objects, std::span<const Object> shading, const Occluders& occluders,
          const Light& light, std::span<LightMap> maps);

/// Linear light as a screen shows it (display-referred, 0 to 1): a filmic curve, then sRGB.
/// Source: Narkowicz 2016, "ACES filmic tone mapping curve".
[[nodiscard]] Vec3 develop(Vec3 linear);

}  // namespace engine::procedural
