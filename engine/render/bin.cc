// Which splats reach which tiles.
#include <cstdint>
#include <limits>
#include <new>
#include <numeric>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

constexpr std::size_t bin_block = 2048;  // splats per unit of parallel work

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
