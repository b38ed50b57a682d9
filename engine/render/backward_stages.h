// What the stages of the SIMD backward pass hand to each other: project -> sort -> bin (as forward) -> walk the tiles
// -> sum per row and pull back the projection.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/render/backward.h"
#include "engine/render/splats.h"

namespace engine::render {

/// SplatGradient of one splat in one group of tiles. In the units of Splat: `along` and `across` are sqrt(log2(e) / 2)
/// times those of SplatGradient.
struct GroupGradient {
  float g, along, across;
  float along_along, along_across, across_across;
  float red, green, blue, depth;
  float padding[2];  ///< To whole vectors of four. Zero where all sums are.
  static constexpr std::size_t sums = 10;
};
static_assert(sizeof(GroupGradient) == 12 * sizeof(float));

/// dL/d(pictures) of one tile: that of pixel (x, y) is at [y * stride + x], and zero for those that are not shown.
/// Planes that are null are zero.
struct TileUpstream {
  const float *red, *green, *blue, *depth, *alpha;
  std::ptrdiff_t stride;
};

/// The sums of gradients that a tile adds to.
struct TilePairs {
  const std::uint32_t* pairs_before;      ///< See ForwardBuffers::pairs_before.
  std::uint32_t group_column, group_row;  ///< Position of the tile's group.
  GroupGradient* sums;
};

/// Pulls back one tile, whose first pixel is (x0, y0).
///   list   splats that reach the tile, nearest first
///   asked  entry of the list in front of which no splat may change
///   background, ends  those of composite_tile()
///   pairs  sums that the gradients of splats that may change are added to
void composite_tile_vjp(const Splat* splats, std::span<const std::uint32_t> list, std::size_t asked, int x0, int y0,
                        const TileUpstream& upstream, Vec3 background, const RayEnds& ends, const TilePairs& pairs);

/// Sums of gradients of pairs, kept from frame to frame. The reader of a sum sets it to zero, since it is in the cache
/// then.
class PairSums {
 public:
  /// Begins a pass. Returns the sums of n pairs, all zero.
  GroupGradient* zeroed(std::size_t n);
  /// Ends a pass: all sums have been read, and are zero again.
  void all_read() { still_zero_ = true; }
  [[nodiscard]] GroupGradient* data() const { return sums_.data(); }

 private:
  Buffer<GroupGradient> sums_;
  std::size_t zeros_ = 0;   ///< Leading sums that were zero when the last pass began.
  bool still_zero_ = true;  ///< Whether they are still; false during a pass, and after one that an exception left.
};

/// The sums for the rows [R] that may change, row by row, so that those of one row lie side by side.
struct RowPairs {
  const std::uint32_t* first_pair;  ///< [R + 1] Row r has the pairs [first_pair[r], first_pair[r + 1]).
  GroupGradient* pairs;
};

/// Upstream by reference; null: zero.
struct UpstreamPlanes {
  const scene::Image* color = nullptr;
  const scene::Image* depth = nullptr;
  const scene::Image* alpha = nullptr;
};

/// Walks all tiles of `forward` back.
///   forward    splats, entries, tile_begin, tile_group and pairs_before are used
///   ends       [tiles] as the forward pass of the same picture left them; null: found anew
///   grid       pixels: the rectangle of the picture that `upstream` is of
///   sums       of each splat in each group of tiles: a pass of theirs begins
void walk_tiles(const ForwardBuffers& forward, const RayEnds* ends, const TileGrid& grid,
                const UpstreamPlanes& upstream, Vec3 background, PairSums& sums);

/// Sums each row's gradients over groups of tiles, in their order, and pulls back projection and colour, for the rows
/// [begin, end) of those that may change. Adds to `out`, but writes mean2d. Leaves the rows' pairs zero.
///   cloud      that holds these rows: cloud row of rows[r] is rows[r] - first_row
///   sh_degree  bands used
void project_rows_vjp(const scene::GaussianCloud& cloud, std::size_t first_row, const ViewParams<float>& view,
                      int sh_degree, std::span<const std::uint32_t> rows, const RowPairs& v_rows, std::size_t begin,
                      std::size_t end, Gradients& out);

/// Most rows project_rows_vjp() takes at once.
constexpr std::size_t project_vjp_block = 256;

/// project_rows_vjp() for all rows that may change, of all layers.
///   first_pair  [rows.size() + 1]
///   sums        as walk_tiles() left them: their pass ends
void project_layers_vjp(const Layers& layers, const ViewParams<float>& view, int sh_degree,
                        std::span<const std::uint32_t> rows, const std::uint32_t* first_pair, PairSums& sums,
                        Gradients& out);

}  // namespace engine::render
