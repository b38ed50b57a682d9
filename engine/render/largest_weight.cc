#include "engine/render/largest_weight.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/render/color_tiles.h"
#include "engine/render/splats.h"

namespace engine::render {

void raise_to_largest_weights(const Layers& layers, const scene::Camera& camera, Workspace& workspace,
                              std::span<float> out) {
  assert(scene::validate(camera) && out.size() == layers.size());
  ForwardBuffers& buffers = workspace.impl_->buffers;
  const TileGrid grid = whole_grid(camera);
  project(layers, view_params<float>(camera), -1, {}, Culling::exact, grid.pixels, buffers);
  sort_by_depth(buffers);
  bin(grid, buffers);
  parallel_for(buffers.tile_begin.size() - 1, 4, [&](std::size_t begin, std::size_t end) {
    std::vector<float> largest;
    for (std::size_t tile = begin; tile < end; ++tile) {
      const std::uint32_t first = buffers.tile_begin[tile], count = buffers.tile_begin[tile + 1] - first;
      largest.resize(count);
      largest_tile_weights(buffers.splats.data(), {buffers.entries.data() + first, count},
                           place_of(tile, grid.columns, grid.pixels), largest.data());
      for (std::size_t k = 0; k < count; ++k) {
        // Several tiles may raise the same row; the largest of them is the same in any order.
        std::atomic_ref<float> row(out[buffers.splats[buffers.entries[first + k]].row]);
        float before = row.load(std::memory_order_relaxed);
        while (before < largest[k] && !row.compare_exchange_weak(before, largest[k], std::memory_order_relaxed)) {
        }
      }
    }
  });
}

}  // namespace engine::render
