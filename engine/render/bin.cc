// Depth order, and which splats reach which tiles.
#include <algorithm>
#include <bit>
#include <limits>
#include <new>
#include <numeric>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

constexpr std::size_t bin_block = 2048;  // splats per unit of parallel work

using Keyed = ForwardBuffers::Keyed;

/// The least and the largest key; {0, 0} if there is none.
std::pair<std::uint32_t, std::uint32_t> range_of_keys(const Keyed* keys, std::size_t n) {
  constexpr std::size_t block = 8192;
  if (n == 0) return {0, 0};
  std::vector<std::pair<std::uint32_t, std::uint32_t>> ranges(chunk_count(n, block));
  parallel_for(n, block, [&](std::size_t begin, std::size_t end) {
    const auto [least, largest] = std::ranges::minmax(std::span(keys + begin, end - begin), {}, &Keyed::key);
    ranges[begin / block] = {least.key, largest.key};
  });
  auto whole = ranges.front();
  for (const auto& [least, largest] : ranges) whole = {std::min(whole.first, least), std::max(whole.second, largest)};
  return whole;
}

/// Stable radix sort by key, of the bits that differ at most 11 at a time, least significant first. Returns whichever
/// buffer holds the result. Each pass counts the digits of fixed blocks side by side, and then each block moves its
/// elements to the places that the blocks before it leave.
Keyed* radix_sort(Keyed* from, Keyed* to, std::size_t n) {
  const std::size_t block = std::max(std::size_t{8192}, (n + 31) / 32);  // few: their counts are added up by one thread
  constexpr int most_bits = 11;
  const std::size_t blocks = chunk_count(n, block);
  const auto [least, largest] = range_of_keys(from, n);
  const int width = std::bit_width(largest - least);
  const int passes = (width + most_bits - 1) / most_bits, bits = passes > 0 ? (width + passes - 1) / passes : 0;
  const std::size_t buckets = std::size_t{1} << bits;
  std::vector<std::uint32_t> places(blocks * buckets);
  for (int shift = 0; shift < width; shift += bits) {
    const auto digit = [=, least = least](const Keyed& keyed) { return (keyed.key - least) >> shift & (buckets - 1); };
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

/// The groups of tiles that a box meets.
struct TileGroups {
  std::uint32_t first_column, first_row, columns, rows;

  TileGroups(const TileBox& box, std::uint32_t side)
      : first_column(box.first_column / side),
        first_row(box.first_row / side),
        columns(box.last_column / side - first_column + 1),
        rows(box.last_row / side - first_row + 1) {}
};

/// Drops the tiles that are not wanted from the lists of splats. Returns their end.
std::uint32_t* keep_wanted(const TileGrid& grid, std::span<std::uint32_t> reached, std::uint32_t* tiles) {
  std::uint32_t* kept = tiles;
  for (std::uint32_t& count : reached) {
    std::uint32_t* const before = kept;
    for (const std::uint32_t* const end = tiles + count; tiles != end; ++tiles)
      if (grid.wanted[*tiles] != 0) *kept++ = *tiles;
    count = std::uint32_t(kept - before);
  }
  return kept;
}

/// Counts the entries of each tile, and what of them is before those of each block; place_entries() puts them there.
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
    std::uint32_t* const listed = block.tiles.reserve(at_most + reached_tiles_slack);
    std::uint32_t* const reached = block.reached.reserve(last - first);
    const std::uint32_t* listed_end =
        list_reached_tiles({buffers.splats.data() + first, last - first}, buffers.boxes.data() + first, grid.columns,
                           block.work, listed, reached);
    if (!grid.wanted.empty()) listed_end = keep_wanted(grid, {reached, last - first}, listed);
    block.listed = std::size_t(listed_end - listed);
    for (const std::uint32_t* tile = listed; tile != listed_end; ++tile) ++block.position[*tile];
    for (std::size_t i = first; i < last; ++i) reached_tiles(i, reached[i - first]);
  });

  // Entries are numbered in 32 bits. More would need 16 GiB for the list alone: out of memory, said before it happens.
  std::uint64_t total = 0;
  for (std::size_t b = 0; b < blocks; ++b) total += buffers.bin_blocks[b].listed;
  if (total > std::numeric_limits<std::uint32_t>::max()) throw std::bad_alloc();
  // A block's entries follow, within a tile, those of the blocks before it.
  std::vector<std::uint32_t>& begin = buffers.tile_begin;
  begin.assign(tiles + 1, 0);
  for (std::size_t b = 0; b < blocks; ++b) {
    std::uint32_t* const position = buffers.bin_blocks[b].position.data();
    for (std::size_t tile = 0; tile < tiles; ++tile) {
      const std::uint32_t count = position[tile];
      position[tile] = begin[tile];
      begin[tile] += count;
    }
  }
  std::exclusive_scan(begin.begin(), begin.end(), begin.begin(), 0u);
  buffers.entries.reserve(begin[tiles]);
}

/// Lists the splats in their tiles.
void place_entries(ForwardBuffers& buffers) {
  std::uint32_t* const entries = buffers.entries.data();
  parallel_for(buffers.count, bin_block, [&](std::size_t first, std::size_t last) {
    auto& block = buffers.bin_blocks[first / bin_block];
    const std::uint32_t* tile = block.tiles.data();
    const std::uint32_t* const reached = block.reached.data();
    std::uint32_t* const position = block.position.data();
    for (std::size_t t = 0; t < block.position.size(); ++t) position[t] += buffers.tile_begin[t];
    for (std::size_t i = first; i < last; ++i) {
      const std::uint32_t* const tiles_end = tile + reached[i - first];
      for (; tile != tiles_end; ++tile) entries[position[*tile]++] = std::uint32_t(i);
    }
  });
}

}  // namespace

void bin(const TileGrid& grid, ForwardBuffers& buffers) {
  count_entries(grid, buffers, [](std::size_t, std::uint32_t) {});
  place_entries(buffers);
}

void bin(const TileGrid& grid, ForwardBuffers& buffers, const std::int32_t* slot_of_row, std::size_t rows) {
  buffers.tile_group = tile_group_side(rows);
  const auto side = std::uint32_t(buffers.tile_group);
  std::uint32_t* const first_pair = buffers.first_pair.reserve(rows + 1);
  std::fill_n(first_pair, rows + 1, 0u);
  PairsOfSplat* const pairs_of_splat = buffers.pairs_of_splat.reserve(buffers.count);
  count_entries(grid, buffers, [&](std::size_t i, std::uint32_t tiles) {
    const std::uint32_t row = buffers.splats[i].row;
    const std::int32_t slot = slot_of_row != nullptr ? slot_of_row[row] : std::int32_t(row);
    pairs_of_splat[i] = {};
    if (slot < 0 || tiles == 0) return;
    const TileGroups groups(buffers.boxes[i], side);
    first_pair[slot] = groups.columns * groups.rows;
    pairs_of_splat[i] = {.first = std::uint32_t(slot), .columns = groups.columns};  // until slots have their numbers
  });
  place_entries(buffers);
  std::uint64_t sum = 0;
  for (std::size_t r = 0; r <= rows; ++r) sum += std::exchange(first_pair[r], std::uint32_t(sum));
  if (sum > std::numeric_limits<std::uint32_t>::max()) throw std::bad_alloc();  // pairs are numbered in 32 bits, too
  parallel_for(buffers.count, bin_block, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      PairsOfSplat& pairs = pairs_of_splat[i];
      if (!pairs.any()) continue;
      const TileGroups groups(buffers.boxes[i], side);
      pairs.first = first_pair[pairs.first] - groups.first_row * groups.columns - groups.first_column;
    }
  });
}

}  // namespace engine::render
