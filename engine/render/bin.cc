// Depth order, and which splats reach which tiles.
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <new>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

constexpr std::size_t bin_block = 2048;  // splats per unit of parallel work

using Keyed = ForwardBuffers::Keyed;

/// Stable radix sort by key, 11 bits at a time, least significant first. Returns whichever buffer holds the result.
/// Each pass counts the digits of fixed blocks side by side, and then each block moves its elements to the places that
/// the blocks before it leave.
Keyed* radix_sort(Keyed* from, Keyed* to, std::size_t n) {
  constexpr std::size_t block = 32768;
  constexpr int bits = 11;
  constexpr std::size_t buckets = std::size_t{1} << bits;
  const std::size_t blocks = chunk_count(n, block);
  std::vector<std::uint32_t> places(blocks * buckets);
  for (int shift = 0; shift < 31; shift += bits) {  // the sign bit is never set
    const auto digit = [shift](const Keyed& keyed) { return keyed.key >> shift & (buckets - 1); };
    parallel_for(n, block, [&](std::size_t begin, std::size_t end) {
      std::uint32_t* count = places.data() + begin / block * buckets;
      std::fill_n(count, buckets, 0u);
      for (std::size_t i = begin; i < end; ++i) ++count[digit(from[i])];
    });
    std::uint32_t sum = 0;
    for (std::size_t bucket = 0; bucket < buckets; ++bucket)
      for (std::size_t b = 0; b < blocks; ++b) sum += std::exchange(places[b * buckets + bucket], sum);
    parallel_for(n, block, [&](std::size_t begin, std::size_t end) {
      std::uint32_t* place = places.data() + begin / block * buckets;
      for (std::size_t i = begin; i < end; ++i) to[place[digit(from[i])]++] = from[i];
    });
    std::swap(from, to);
  }
  return from;
}

/// The ellipse q <= q_max of a splat, for asking where it lies within a band of pixel rows.
class Ellipse {
 public:
  explicit Ellipse(const Splat& splat) : x_(splat.x), y_(splat.y) {
    // u = l1 dx + l2 dy and v = l3 dy run over a disc of this radius. The margin covers rounding here and in the blend.
    const float radius = std::sqrt(std::max(0.0f, splat.log2_opacity + log2_255 + 1e-3f));
    const float inverse_l1 = 1 / splat.l1;
    slope_ = -splat.l2 * inverse_l1;
    half_y_ = radius / splat.l3;
    inverse_half_y_ = splat.l3 / radius;
    radius_over_l1_ = radius * inverse_l1;
    const float tilt = splat.l2 / splat.l3;
    rightmost_dy_ = -tilt / std::sqrt(1 + tilt * tilt) * half_y_;
    margin_ = 0.01f + 1e-5f * (radius_over_l1_ + std::abs(slope_) * half_y_);
  }
  struct Extent {
    float left, right;
  };
  /// Smallest and largest x of the ellipse over the pixel rows [row0, row1].
  [[nodiscard]] Extent over_rows(float row0, float row1) const {
    const float low = std::clamp(row0 - y_, -half_y_, half_y_), high = std::clamp(row1 - y_, -half_y_, half_y_);
    return {x_ - reach(std::clamp(rightmost_dy_, -high, -low)), x_ + reach(std::clamp(rightmost_dy_, low, high))};
  }

 private:
  /// x of the right edge at height dy, relative to the mean; concave in dy. The left edge is its point reflection.
  [[nodiscard]] float reach(float dy) const {
    const float t = dy * inverse_half_y_;
    return slope_ * dy + radius_over_l1_ * std::sqrt(std::max(0.0f, 1 - t * t)) + margin_;
  }
  float x_, y_, slope_, half_y_, inverse_half_y_, radius_over_l1_, rightmost_dy_, margin_;
};

/// Calls visit(tile) for every tile that holds a pixel within reach of the splat (and rarely for one that just misses).
template <class Visit>
void visit_tiles(const Splat& splat, TileBox box, int columns, Visit&& visit) {
  if (box.first_column == box.last_column || box.first_row == box.last_row) {  // here the bounding box is tight
    for (int ty = box.first_row; ty <= box.last_row; ++ty)
      for (int tx = box.first_column; tx <= box.last_column; ++tx) visit(std::uint32_t(ty * columns + tx));
    return;
  }
  const Ellipse ellipse(splat);
  for (int ty = box.first_row; ty <= box.last_row; ++ty) {
    const auto extent = ellipse.over_rows(float(ty * tile_size), float(ty * tile_size + tile_size - 1));
    // Tile tx holds the pixel centres 16 tx to 16 tx + 15. Clamped before conversion: a splat may reach past any int.
    const float low = std::max(extent.left, float(box.first_column * tile_size));
    const float high = std::min(extent.right, float(box.last_column * tile_size + tile_size - 1));
    if (!(low <= high)) continue;
    const int first = (int(low) + (float(int(low)) < low ? 1 : 0)) / tile_size, last = int(high) / tile_size;
    for (int tx = first; tx <= last; ++tx) visit(std::uint32_t(ty * columns + tx));
  }
}

}  // namespace

void sort_by_depth(ForwardBuffers& buffers) {
  const auto& blocks = buffers.block_sizes;
  std::vector<std::size_t> begin(blocks.size() + 1, 0);
  for (std::size_t b = 0; b < blocks.size(); ++b) begin[b + 1] = begin[b] + blocks[b];
  buffers.count = begin.back();
  Keyed* keys = buffers.keys.reserve(buffers.count);
  Keyed* scratch = buffers.keys_scratch.reserve(buffers.count);
  parallel_for(blocks.size(), 8, [&](std::size_t first, std::size_t last) {
    for (std::size_t b = first; b < last; ++b)
      for (std::size_t k = 0; k < blocks[b]; ++k) {
        const std::size_t index = b * project_block + k;
        keys[begin[b] + k] = {std::bit_cast<std::uint32_t>(buffers.projected[index].depth), std::uint32_t(index)};
      }
  });
  const Keyed* order = radix_sort(keys, scratch, buffers.count);
  Splat* splats = buffers.splats.reserve(buffers.count);
  TileBox* boxes = buffers.boxes.reserve(buffers.count);
  parallel_for(buffers.count, bin_block, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      splats[i] = buffers.projected[order[i].index];
      boxes[i] = buffers.projected_boxes[order[i].index];
    }
  });
}

namespace {

/// Counts the entries of each tile and says where they go; place_entries() puts them there.
/// Calls reached_tiles(i, n) for each splat: in how many tiles it is listed.
template <class Reached>
void count_entries(const TileGrid& grid, ForwardBuffers& buffers, Reached&& reached_tiles) {
  const std::size_t tiles = std::size_t(grid.columns) * std::size_t(grid.rows);
  const std::size_t blocks = chunk_count(buffers.count, bin_block);
  if (buffers.bin_blocks.size() < blocks) buffers.bin_blocks.resize(blocks);

  // Each block lists the tiles of its splats, and counts them per tile.
  parallel_for(buffers.count, bin_block, [&](std::size_t first, std::size_t last) {
    auto& block = buffers.bin_blocks[first / bin_block];
    block.position.assign(tiles, 0);
    std::size_t at_most = 0;
    for (std::size_t i = first; i < last; ++i) {
      const TileBox& box = buffers.boxes[i];
      at_most += std::size_t(box.last_column - box.first_column + 1) * std::size_t(box.last_row - box.first_row + 1);
    }
    std::uint32_t* next = block.tiles.reserve(at_most);
    std::uint32_t* reached = block.reached.reserve(last - first);
    for (std::size_t i = first; i < last; ++i) {
      const std::uint32_t* const before = next;
      visit_tiles(buffers.splats[i], buffers.boxes[i], grid.columns, [&](std::uint32_t tile) {
        if (!grid.wanted.empty() && grid.wanted[tile] == 0) return;
        *next++ = tile;
        ++block.position[tile];
      });
      *reached++ = std::uint32_t(next - before);
      reached_tiles(i, std::uint32_t(next - before));
    }
  });

  buffers.tile_begin.resize(tiles + 1);
  // Entries are numbered in 32 bits. More would need 16 GiB for the list alone: out of memory, said before it happens.
  std::uint64_t total = 0;
  for (std::size_t b = 0; b < blocks; ++b)
    for (const std::uint32_t count : buffers.bin_blocks[b].position) total += count;
  if (total > std::numeric_limits<std::uint32_t>::max()) throw std::bad_alloc();
  std::uint32_t sum = 0;
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    buffers.tile_begin[tile] = sum;
    for (std::size_t b = 0; b < blocks; ++b) sum += std::exchange(buffers.bin_blocks[b].position[tile], sum);
  }
  buffers.tile_begin[tiles] = sum;

  buffers.entries.reserve(sum);
}

/// Lists the splats in their tiles. placing(i) returns what is told of each entry of splat i, in the order of tiles.
template <class Placing>
void place_entries(ForwardBuffers& buffers, Placing&& placing) {
  std::uint32_t* const entries = buffers.entries.data();
  parallel_for(buffers.count, bin_block, [&](std::size_t first, std::size_t last) {
    auto& block = buffers.bin_blocks[first / bin_block];
    const std::uint32_t* tile = block.tiles.data();
    const std::uint32_t* const reached = block.reached.data();
    std::uint32_t* const position = block.position.data();
    for (std::size_t i = first; i < last; ++i) {
      auto placed = placing(i);
      for (const std::uint32_t* const tiles_end = tile + reached[i - first]; tile != tiles_end; ++tile) {
        const std::uint32_t at = position[*tile]++;
        entries[at] = std::uint32_t(i);
        placed(at);
      }
    }
  });
}

}  // namespace

void bin(const TileGrid& grid, ForwardBuffers& buffers) {
  count_entries(grid, buffers, [](std::size_t, std::uint32_t) {});
  place_entries(buffers, [](std::size_t) { return [](std::uint32_t) {}; });
}

void bin(const TileGrid& grid, ForwardBuffers& buffers, const std::int32_t* slot_of_splat, std::size_t rows) {
  std::uint32_t* const first_pair = buffers.first_pair.reserve(rows + 1);
  std::fill_n(first_pair, rows + 1, 0u);
  count_entries(grid, buffers, [&](std::size_t i, std::uint32_t tiles) {
    if (slot_of_splat[i] >= 0) first_pair[slot_of_splat[i]] = tiles;
  });
  std::uint32_t sum = 0;
  for (std::size_t r = 0; r <= rows; ++r) sum += std::exchange(first_pair[r], sum);
  std::uint32_t* const pair_of_entry = buffers.pair_of_entry.reserve(buffers.tile_begin.back());
  place_entries(buffers, [&](std::size_t i) {
    const bool changeable = slot_of_splat[i] >= 0;
    const std::uint32_t step = changeable ? 1 : 0;
    std::uint32_t pair = changeable ? first_pair[slot_of_splat[i]] : ForwardBuffers::no_pair;
    return [pair_of_entry, pair, step](std::uint32_t at) mutable {
      pair_of_entry[at] = pair;
      pair += step;
    };
  });
}

}  // namespace engine::render
