#include "engine/render/weight_sums.h"

#include <array>
#include <cassert>
#include <cstddef>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/render/listed_tiles.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

/// The values of a tile's pixels, row by row; 0 beyond the picture.
std::array<float, TilePixels::count> values_of(const scene::Image& value, TilePlace place) {
  std::array<float, TilePixels::count> out{};
  for (int y = 0; y < tile_size && place.y0 + y < value.height; ++y)
    for (int x = 0; x < tile_size && place.x0 + x < value.width; ++x)
      out[std::size_t(y * tile_size + x)] = value.at(place.x0 + x, place.y0 + y);
  return out;
}

}  // namespace

void add_weight_sums(const Layers& layers, const scene::Camera& camera, const scene::Image& value, Workspace& workspace,
                     std::span<double> all, std::span<double> valued) {
  assert(all.size() == layers.size() && valued.size() == layers.size());
  assert(value.width == camera.width && value.height == camera.height && value.channels == 1);
  ForwardBuffers& buffers = workspace.impl_->buffers;
  const TileGrid grid = list_splats(layers, camera, buffers);
  const std::size_t entries = buffers.tile_begin.back();
  std::vector<float> entry_all(entries), entry_valued(entries);
  parallel_for(buffers.tile_begin.size() - 1, 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t tile = begin; tile < end; ++tile) {
      const auto [place, first, list] = listed_tile(grid, buffers, tile);
      sum_tile_weights(buffers.splats.data(), list, place, values_of(value, place).data(), entry_all.data() + first,
                       entry_valued.data() + first);
    }
  });
  // On one thread: a row may be in several tiles, and the order of its sum must not depend on the number of threads.
  for (std::size_t entry = 0; entry < entries; ++entry) {
    const std::uint32_t row = buffers.splats[buffers.entries[entry]].row;
    all[row] += double(entry_all[entry]);
    valued[row] += double(entry_valued[entry]);
  }
}

}  // namespace engine::render
