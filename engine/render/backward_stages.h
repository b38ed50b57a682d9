// What the stages of the SIMD backward pass hand to each other: project -> sort -> bin (as forward) -> walk the tiles
// -> sum per row and pull back the projection.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/core/parallel.h"
#include "engine/render/backward.h"
#include "engine/render/splats.h"

namespace engine::render {

/// SplatGradient of one splat in one tile. In the units of Splat: `along` and `across` are sqrt(log2(e) / 2) times
/// those of SplatGradient.
struct TileGradient {
  float g, along, across;
  float along_along, along_across, across_across;
  float red, green, blue, depth;
  float padding[2];  ///< To whole vectors of four. Zero where all sums are.
  static constexpr std::size_t sums = 10;
};
static_assert(sizeof(TileGradient) == 12 * sizeof(float));

/// dL/d(pictures) of one tile, row-major 16 x 16; zero outside the picture.
struct alignas(64) TileUpstream {
  float red[TilePixels::count], green[TilePixels::count], blue[TilePixels::count];
  float depth[TilePixels::count];
  float transmittance[TilePixels::count];  ///< dL/dT behind all: background . color - alpha
};

/// Pulls back one tile.
///   list           splats that reach the tile, nearest first
///   pair_of_entry  [list.size()] number of the pair, or ForwardBuffers::no_pair if the splat's row may not change
///   with_depth     whether upstream.depth is anything but zero
///   ends           as composite_tile() left them
///   pairs          those with a number are written
void composite_tile_vjp(const Splat* splats, std::span<const std::uint32_t> list, const std::uint32_t* pair_of_entry,
                        int x0, int y0, const TileUpstream& upstream, bool with_depth, const RayEnds& ends,
                        TileGradient* pairs);

/// Where the gradients of the rows [R] that may change are: row by row, so that what a row needs lies side by side.
struct RowPairs {
  const std::uint32_t* first_pair;  ///< [R + 1] Row r has the pairs [first_pair[r], first_pair[r + 1]).
  const TileGradient* pairs;
};

/// What walk_tiles() works in.
struct WalkBuffers {
  Buffer<std::int32_t> slot_of_splat;  ///< [splats] Where a splat's row is in the list of those that may change, or -1.
  Buffer<TileGradient> pairs;          ///< As ForwardBuffers::first_pair numbers them.
};

/// Upstream by reference; null: zero.
struct UpstreamPlanes {
  const scene::Image* color = nullptr;
  const scene::Image* depth = nullptr;
  const scene::Image* alpha = nullptr;
};

/// Fills slot_of_splat from where each Splat::row is in the list of rows that may change, or -1.
template <class SlotOfRow>
const std::int32_t* find_slots(const ForwardBuffers& forward, SlotOfRow&& slot_of_row, Buffer<std::int32_t>& buffer) {
  std::int32_t* const slots = buffer.reserve(forward.count);
  parallel_for(forward.count, 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) slots[i] = slot_of_row(forward.splats[i].row);
  });
  return slots;
}

/// Walks all tiles of `forward` back.
///   forward  splats, entries, tile_begin and pair_of_entry are used
///   ends     [tiles] as the forward pass of the same picture left them; null: found anew
///   grid     pixels: the rectangle of the picture that `upstream` is of
///   pairs    there are, as pair_of_entry numbers them
///   work     all numbered pairs are written
void walk_tiles(const ForwardBuffers& forward, const RayEnds* ends, const TileGrid& grid,
                const UpstreamPlanes& upstream, Vec3 background, std::size_t pairs, WalkBuffers& work);

/// Sums each row's gradients over tiles, in their order, and pulls back projection and colour, for the rows [begin,
/// end) of those that may change. Adds to `out`, but writes mean2d.
///   cloud      that holds these rows: cloud row of rows[r] is rows[r] - first_row
///   sh_degree  bands used
void project_rows_vjp(const scene::GaussianCloud& cloud, std::size_t first_row, const ViewParams<float>& view,
                      int sh_degree, std::span<const std::uint32_t> rows, const RowPairs& v_rows, std::size_t begin,
                      std::size_t end, Gradients& out);

/// Most rows project_rows_vjp() takes at once.
constexpr std::size_t project_vjp_block = 256;

}  // namespace engine::render
