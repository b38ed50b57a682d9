#include "engine/render/layers.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

std::size_t count_below(std::span<const std::uint32_t> ascending, std::size_t row) {
  return std::size_t(std::lower_bound(ascending.begin(), ascending.end(), row) - ascending.begin());
}

}  // namespace

std::uint32_t Layers::merged_row(std::size_t row) const {
  const auto without_removed = [&](std::size_t base_row) {
    return std::uint32_t(base_row - (count_below(hidden, base_row) - count_below(changed, base_row)));
  };
  if (row < base->size()) return without_removed(row);
  const std::size_t j = row - base->size();
  if (j < changed.size()) return without_removed(changed[j]);
  return std::uint32_t(base->size() - hidden.size() + j);
}

DrawnVersion::DrawnVersion(scene::LayeredCloud version) : version_(std::move(version)) {
  if (!version_.overlay) return;
  const scene::Overlay& overlay = *version_.overlay;
  hidden_.reserve(overlay.removed.size() + overlay.changed.size());
  std::merge(overlay.removed.begin(), overlay.removed.end(), overlay.changed.begin(), overlay.changed.end(),
             std::back_inserter(hidden_));
}

Layers DrawnVersion::layers() const {
  Layers layers(*version_.base);
  if (!version_.overlay) return layers;
  layers.top = &version_.overlay->rows;
  layers.hidden = hidden_;
  layers.changed = version_.overlay->changed;
  return layers;
}

void project(const Layers& layers, const ViewParams<float>& view, int sh_degree, std::span<const float> weight,
             Culling culling, scene::Rect pixels, ForwardBuffers& buffers) {
  const std::size_t base_rows = layers.base->size(), top_rows = layers.top ? layers.top->size() : 0;
  const std::size_t base_blocks = chunk_count(base_rows, project_block),
                    top_blocks = chunk_count(top_rows, project_block);
  const std::size_t room = top_blocks == 0 ? base_rows : base_blocks * project_block + top_rows;
  Splat* const splats = buffers.projected.reserve(room);
  TileBox* const boxes = buffers.projected_boxes.reserve(room);
  buffers.block_sizes.resize(base_blocks + top_blocks);
  const auto project_layer = [&](const ProjectedLayer& layer, std::size_t first_block) {
    parallel_for(layer.cloud.size(), project_block, [&](std::size_t begin, std::size_t end) {
      const std::size_t block = first_block + begin / project_block;
      buffers.block_sizes[block] = project_rows(layer, view, sh_degree, culling, pixels, begin, end,
                                                splats + block * project_block, boxes + block * project_block);
    });
  };
  project_layer({*layers.base, layers.hidden, 0, weight.empty() ? nullptr : weight.data()}, 0);
  if (layers.top)
    project_layer({*layers.top, {}, base_rows, weight.empty() ? nullptr : weight.data() + base_rows}, base_blocks);
}

}  // namespace engine::render
