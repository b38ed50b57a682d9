// What the made-up things are made of. Colours are linear; points are in the object's frame, world units.
#pragma once

#include "engine/procedural/surface.h"

namespace engine::procedural {

/// A colour written as on a screen (sRGB, 0 to 255), made linear.
[[nodiscard]] Vec3 srgb(int red, int green, int blue);

/// Smooth noise of wavelength 1, in [-1, 1].
[[nodiscard]] float noise(Vec3 point);
/// Noise of several octaves, each half as large and twice as fine; about [-1, 1].
[[nodiscard]] float fractal_noise(Vec3 point, int octaves);

[[nodiscard]] Material plain(Vec3 albedo, float gloss = 0);
[[nodiscard]] Material wood(Vec3 light, Vec3 dark, float board_width);  ///< Boards along x, grain along them.
[[nodiscard]] Material floorboards();
[[nodiscard]] Material plaster(Vec3 albedo);
[[nodiscard]] Material terracotta(float band_low, float band_high);  ///< A painted zigzag band between two heights.
[[nodiscard]] Material soil();
[[nodiscard]] Material foliage(float age);  ///< 0 young and yellowish, 1 old and dark; u, v as leaf() lays them.
[[nodiscard]] Material stalk();
[[nodiscard]] Material striped_ceramic(Vec3 glaze, Vec3 stripe, float radius);  ///< For a ball around its middle.
[[nodiscard]] Material two_tone_glaze(Vec3 lower, Vec3 upper, float height);
[[nodiscard]] Material apple_skin();
[[nodiscard]] Material cloth_cover(Vec3 albedo);
[[nodiscard]] Material page_edges();
[[nodiscard]] Material landscape_print();  ///< Over the whole patch, v downwards.

}  // namespace engine::procedural
