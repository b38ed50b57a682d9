#include "engine/render/largest_weight.h"

#include <atomic>
#include <cassert>
#include <cstddef>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/render/listed_tiles.h"
#include "engine/render/splats.h"

namespace engine::render {

void raise_to_largest_weights(const Layers& layers, const scene::Camera& camera, Workspace& workspace,
                              std::span<float> out) {
  assert(out.size() == layers.size());
  ForwardBuffers& buffers = workspace.impl_->buffers;
  const TileGrid grid = list_splats(layers, camera, buffers);
  parallel_for(buffers.tile_begin.size() - 1, 4, [&](std::size_t begin, std::size_t end) {
    std::vector<float> largest;
    for (std::size_t tile = begin; tile < end; ++tile) {
      const auto [place, first, list] = listed_tile(grid, buffers, tile);
      largest.resize(list.size());
      largest_tile_weights(buffers.splats.data(), list, place, largest.data());
      for (std::size_t k = 0; k < list.size(); ++k) {
        // Several tiles may raise the same row; the largest of them is the same in any order.
        std::atomic_ref<float> row(out[buffers.splats[list[k]].row]);
        float before = row.load(std::memory_order_relaxed);
        while (before < largest[k] && !row.compare_exchange_weak(before, largest[k], std::memory_order_relaxed)) {
        }
      }
    }
  });
}

std::vector<float> largest_weights(const Layers& layers, std::span<const scene::Camera> cameras) {
  std::vector<float> out(layers.size(), 0.0f);
  Workspace workspace;
  for (const scene::Camera& camera : cameras) raise_to_largest_weights(layers, camera, workspace, out);
  return out;
}

}  // namespace engine::render
