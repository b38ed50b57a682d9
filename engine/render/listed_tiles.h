// The tiles of a whole picture with the splats that each of them lists: for passes that ask for weights, not colours.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/render/color_tiles.h"
#include "engine/render/splats.h"

namespace engine::render {

/// Lists the splats of all tiles of the camera's picture, without colours, in the buffers.
/// Precondition: that of forward().
inline TileGrid list_splats(const Layers& layers, const scene::Camera& camera, ForwardBuffers& buffers) {
  assert(scene::validate(camera));
  TileGrid grid = whole_grid(camera);
  project(layers, view_params<float>(camera), -1, {}, Culling::exact, grid.pixels, buffers);
  sort_by_depth(buffers);
  bin(grid, buffers);
  return grid;
}

/// A tile with its list.
struct ListedTile {
  TilePlace place;
  std::size_t first;                    ///< The list begins there in ForwardBuffers::entries.
  std::span<const std::uint32_t> list;  ///< Indices into ForwardBuffers::splats, nearest first.
};

inline ListedTile listed_tile(const TileGrid& grid, const ForwardBuffers& buffers, std::size_t tile) {
  const std::uint32_t first = buffers.tile_begin[tile], last = buffers.tile_begin[tile + 1];
  return {place_of(tile, grid.columns, grid.pixels), first, {buffers.entries.data() + first, last - first}};
}

}  // namespace engine::render
