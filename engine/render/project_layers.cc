// Projection, block by block, and what is best found while a block is in the cache: keys of its depths, and numbers of
// its pairs with groups of tiles.
#include <algorithm>
#include <bit>
#include <cassert>
#include <limits>
#include <new>
#include <span>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

/// The rows of each block: those of the base, then those on top of it. [blocks + 1]
std::vector<std::size_t> rows_of_blocks(const Layers& layers) {
  std::vector<std::size_t> first;
  const std::size_t base_rows = layers.base->size();
  for (std::size_t row = 0; row < base_rows; row += project_block) first.push_back(row);
  for (std::size_t row = base_rows; row < layers.size(); row += project_block) first.push_back(row);
  first.push_back(layers.size());
  return first;
}

KeyRange key_by_depth(std::size_t block, const ForwardBuffers& buffers) {
  KeyRange range;
  const std::size_t first = block * project_block;
  for (std::size_t i = first; i < first + buffers.block_sizes[block]; ++i) {
    const auto key = std::bit_cast<std::uint32_t>(buffers.splats[i].depth);
    buffers.keys[i] = {key, std::uint32_t(i)};
    range.extend({key, key});
  }
  return range;
}

///   first_row    rows_of_blocks()
///   after_block  after_block(b) is called for each block once it is projected
template <class AfterBlock>
void project_blocks(const Layers& layers, std::span<const std::size_t> first_row, const ViewParams<float>& view,
                    int sh_degree, std::span<const float> weight, Culling culling, scene::Rect pixels,
                    ForwardBuffers& buffers, AfterBlock&& after_block) {
  const std::size_t blocks = first_row.size() - 1, base_rows = layers.base->size();
  buffers.splats.reserve(blocks * project_block), buffers.keys.reserve(blocks * project_block);
  buffers.block_sizes.resize(blocks), buffers.key_ranges.resize(blocks);
  const auto layer = [&](const scene::GaussianCloud& cloud, std::span<const std::uint32_t> hidden, std::size_t first) {
    return ProjectedLayer{cloud, hidden, first, weight.empty() ? nullptr : weight.data() + first};
  };
  const ProjectedLayer base = layer(*layers.base, layers.hidden, 0);
  const ProjectedLayer top = layers.top ? layer(*layers.top, {}, base_rows) : base;
  parallel_for(blocks, 1, [&](std::size_t b, std::size_t) {
    const ProjectedLayer& of = first_row[b] < base_rows ? base : top;
    buffers.block_sizes[b] = project_rows(of, view, sh_degree, culling, pixels, first_row[b] - of.first_row,
                                          first_row[b + 1] - of.first_row, buffers.splats.data() + b * project_block);
    buffers.key_ranges[b] = key_by_depth(b, buffers);
    after_block(b);
  });
}

/// The groups of tiles that a box meets.
struct TileGroups {
  std::uint32_t first_column, first_row, columns, rows;

  TileGroups(const TileBox& box, int side) {
    assert(side == 1 || side == large_tile_group);
    // By a constant: a division costs as much as all the rest.
    const auto group = [side](std::uint32_t tile) { return side == 1 ? tile : tile / large_tile_group; };
    first_column = group(box.first_column), first_row = group(box.first_row);
    columns = group(box.last_column) - first_column + 1, rows = group(box.last_row) - first_row + 1;
  }
};

/// Numbers the pairs of a block's splats from zero on. Returns how many there are.
///   rows        that may change, of this block
///   first_pair  [rows.size()]
std::uint64_t number_pairs(std::span<const std::uint32_t> rows, int side, std::span<Splat> splats,
                           std::uint32_t* first_pair) {
  std::uint64_t sum = 0;
  std::size_t slot = 0;
  for (Splat& splat : splats) {
    while (slot < rows.size() && rows[slot] < splat.row) first_pair[slot++] = std::uint32_t(sum);
    if (slot == rows.size() || rows[slot] != splat.row) continue;
    const TileGroups groups(splat.box, side);
    splat.pairs = {.first = std::uint32_t(sum) - groups.first_row * groups.columns - groups.first_column,
                   .columns = groups.columns};
    first_pair[slot++] = std::uint32_t(sum);
    sum += std::uint64_t(groups.columns) * groups.rows;
  }
  std::fill(first_pair + slot, first_pair + rows.size(), std::uint32_t(sum));
  return sum;
}

}  // namespace

void project(const Layers& layers, const ViewParams<float>& view, int sh_degree, std::span<const float> weight,
             Culling culling, scene::Rect pixels, ForwardBuffers& buffers) {
  project_blocks(layers, rows_of_blocks(layers), view, sh_degree, weight, culling, pixels, buffers, [](std::size_t) {});
}

void project(const Layers& layers, const ViewParams<float>& view, int sh_degree, scene::Rect pixels,
             std::span<const std::uint32_t> changeable, ForwardBuffers& buffers) {
  const std::vector<std::size_t> first_row = rows_of_blocks(layers);
  const std::size_t blocks = first_row.size() - 1;
  std::vector<std::size_t> slots;  // [blocks + 1] where the rows of a block begin among the changeable ones
  for (const std::size_t row : first_row)
    slots.push_back(std::size_t(std::lower_bound(changeable.begin(), changeable.end(), row) - changeable.begin()));
  buffers.tile_group = tile_group_side(changeable.size());
  std::uint32_t* const first_pair = buffers.first_pair.reserve(changeable.size() + 1);
  std::vector<std::uint64_t> pairs(blocks);
  project_blocks(layers, first_row, view, sh_degree, {}, Culling::exact, pixels, buffers, [&](std::size_t b) {
    pairs[b] = number_pairs(changeable.subspan(slots[b], slots[b + 1] - slots[b]), buffers.tile_group,
                            {buffers.splats.data() + b * project_block, buffers.block_sizes[b]}, first_pair + slots[b]);
  });

  buffers.pairs_before.resize(blocks + 1);
  std::uint64_t before = 0;
  for (std::size_t b = 0; b < blocks; ++b) buffers.pairs_before[b] = std::uint32_t(before), before += pairs[b];
  if (before > std::numeric_limits<std::uint32_t>::max()) throw std::bad_alloc();  // pairs are numbered in 32 bits
  buffers.pairs_before[blocks] = first_pair[changeable.size()] = std::uint32_t(before);
  parallel_for(blocks, 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b)
      for (std::size_t slot = slots[b]; slot < slots[b + 1]; ++slot) first_pair[slot] += buffers.pairs_before[b];
  });
}

}  // namespace engine::render
