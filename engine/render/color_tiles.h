// Tiles of pictures that hold nothing but colour: what passes that are differentiated have in common.
#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "engine/render/splats.h"

namespace engine::render {

/// All tiles of the camera's picture.
inline TileGrid whole_grid(const scene::Camera& camera) {
  return {.columns = tile_columns(camera.width),
          .rows = tile_rows(camera.height),
          .pixels = {0, 0, camera.width, camera.height},
          .wanted = {}};
}

/// Makes rows that are kept from frame to frame 0, 1, ... n - 1.
inline void count_up(std::size_t n, std::vector<std::uint32_t>& rows) {
  if (rows.size() == n) return;
  rows.resize(n);
  std::iota(rows.begin(), rows.end(), 0u);
}

/// Blends a tile of the listed splats and copies it to a picture of `region`, which begins at a tile's edge and holds
/// the tile as far as the whole picture does.
///   ends  null: not needed
inline void draw_tile(const Splat* splats, std::span<const std::uint32_t> list, std::uint32_t tile, int columns,
                      Vec3 background, scene::Rect region, scene::Image& color, RayEnds* ends = nullptr) {
  const TilePlace place = place_of(tile, columns, region);
  const auto pixels_of = [&](int channel) {
    return color.plane(channel).data() + place_in(region, place.x0, place.y0);
  };
  for (int channel = 0; channel < 3; ++channel) fetch_tile(pixels_of(channel), color.width, place.width, place.height);
  TilePixels pixels;
  composite_tile(splats, list, place, {.color = true}, background, pixels, ends);
  int channel = 0;
  for (const float* from : {pixels.red, pixels.green, pixels.blue})
    copy_tile_plane(from, {0, 0, place.width, place.height}, pixels_of(channel++), color.width);
}

}  // namespace engine::render
