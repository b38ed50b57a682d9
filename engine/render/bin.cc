// Depth order, and which splats reach which tiles.
#include <algorithm>
#include <bit>
#include <limits>
#include <new>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

constexpr std::size_t bin_block = 2048;  // splats per unit of parallel work

/// Where each block's elements of a digit go in a pass of a radix sort: after those of lesser digits, and after the
/// same ones of the blocks before.
void place_digits(std::size_t blocks, std::size_t buckets, std::vector<std::uint32_t>& counts) {
  std::uint32_t sum = 0;
  for (std::size_t bucket = 0; bucket < buckets; ++bucket)
    for (std::size_t b = 0; b < blocks; ++b) sum += std::exchange(counts[b * buckets + bucket], sum);
}

}  // namespace

// A stable radix sort, of the bits that differ at most 11 at a time, least significant first. Each pass counts the
// digits of fixed blocks side by side, and then each block moves its elements to the places that the blocks before it
// leave. The first one takes the keys from where projection left them.
void sort_by_depth(ForwardBuffers& buffers) {
  KeyRange range;
  for (const KeyRange& of_block : buffers.key_ranges) range.extend(of_block);
  const auto& sizes = buffers.block_sizes;
  const auto n = std::accumulate(sizes.begin(), sizes.end(), std::size_t{0});
  for (auto& buffer : buffers.sorted) buffer.reserve(n);
  buffers.by_depth = {buffers.sorted[0].data(), n};
  if (n == 0) return;

  constexpr int most_bits = 11;
  constexpr std::size_t most_blocks = 32;  // their counts are added up by one thread
  const int width = std::max(1, int(std::bit_width(range.largest - range.least)));
  const int passes = (width + most_bits - 1) / most_bits, bits = (width + passes - 1) / passes;
  const std::size_t buckets = std::size_t{1} << bits;
  std::vector<std::uint32_t> counts;
  // each(begin, end, use) calls use() for some of the elements.
  const auto pass = [&](int shift, std::size_t length, std::size_t block, auto&& each, DepthKey* to) {
    const auto digit = [=, least = range.least](const DepthKey& keyed) {
      return (keyed.key - least) >> shift & (buckets - 1);
    };
    counts.resize(chunk_count(length, block) * buckets);
    parallel_for(length, block, [&](std::size_t begin, std::size_t end) {
      std::uint32_t* const count = counts.data() + begin / block * buckets;
      std::fill_n(count, buckets, 0u);
      each(begin, end, [&](const DepthKey& keyed) { ++count[digit(keyed)]; });
    });
    place_digits(chunk_count(length, block), buckets, counts);
    parallel_for(length, block, [&](std::size_t begin, std::size_t end) {
      std::uint32_t* const place = counts.data() + begin / block * buckets;
      each(begin, end, [&](const DepthKey& keyed) { to[place[digit(keyed)]++] = keyed; });
    });
  };
  const auto block_of = [&](std::size_t length, std::size_t least) {
    return std::max(least, (length + most_blocks - 1) / most_blocks);
  };
  const auto projected = [&](std::size_t begin, std::size_t end, auto&& use) {
    for (std::size_t b = begin; b < end; ++b)
      for (const DepthKey& keyed : std::span(buffers.keys.data() + b * project_block, sizes[b])) use(keyed);
  };
  const auto sorted = [&](std::size_t begin, std::size_t end, auto&& use) {
    for (const DepthKey& keyed : buffers.by_depth.subspan(begin, end - begin)) use(keyed);
  };
  pass(0, sizes.size(), block_of(sizes.size(), 8), projected, buffers.sorted[0].data());
  for (int p = 1; p < passes; ++p) {
    DepthKey* const to = buffers.sorted[std::size_t(p % 2)].data();
    pass(p * bits, n, block_of(n, 8 * project_block), sorted, to);
    buffers.by_depth = {to, n};
  }
}

namespace {

/// Drops the tiles that are not wanted.
void keep_wanted(const TileGrid& grid, ReachedTiles& reached) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < reached.count; ++i) {
    if (grid.wanted[reached.tiles[i]] == 0) continue;
    reached.tiles[kept] = reached.tiles[i], reached.splats[kept++] = reached.splats[i];
  }
  reached.count = kept;
}

/// Lists the tiles of each block's splats, and counts them per tile.
void list_blocks(const TileGrid& grid, std::size_t tiles, ForwardBuffers& buffers) {
  parallel_for(buffers.by_depth.size(), bin_block, [&](std::size_t first, std::size_t last) {
    auto& block = buffers.bin_blocks[first / bin_block];
    list_reached_tiles(buffers.splats.data(), buffers.by_depth.subspan(first, last - first), grid.columns,
                       block.reached);
    if (!grid.wanted.empty()) keep_wanted(grid, block.reached);
    block.position.assign(tiles, 0);
    const std::uint32_t* const listed = block.reached.tiles.data();
    for (std::size_t i = 0; i < block.reached.count; ++i) ++block.position[listed[i]];
  });
}

/// What of each tile's entries is before those of each block. Returns how many entries there are.
std::uint32_t place_blocks(std::size_t tiles, std::size_t blocks, ForwardBuffers& buffers) {
  // Entries are numbered in 32 bits. More would need 16 GiB for the list alone: out of memory, said before it happens.
  std::uint64_t total = 0;
  for (std::size_t b = 0; b < blocks; ++b) total += buffers.bin_blocks[b].reached.count;
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
  return begin[tiles];
}

}  // namespace

void bin(const TileGrid& grid, ForwardBuffers& buffers) {
  const std::size_t tiles = std::size_t(grid.columns) * std::size_t(grid.rows);
  const std::size_t blocks = chunk_count(buffers.by_depth.size(), bin_block);
  if (buffers.bin_blocks.size() < blocks) buffers.bin_blocks.resize(blocks);
  list_blocks(grid, tiles, buffers);
  std::uint32_t* const entries = buffers.entries.reserve(place_blocks(tiles, blocks, buffers));
  parallel_for(blocks, 1, [&](std::size_t b, std::size_t) {
    auto& block = buffers.bin_blocks[b];
    std::uint32_t* const position = block.position.data();
    for (std::size_t tile = 0; tile < tiles; ++tile) position[tile] += buffers.tile_begin[tile];
    const std::uint32_t* const listed = block.reached.tiles.data();
    const std::uint32_t* const splats = block.reached.splats.data();
    for (std::size_t i = 0; i < block.reached.count; ++i) entries[position[listed[i]]++] = splats[i];
  });
}

}  // namespace engine::render
