// What the stages of the SIMD backward pass hand to each other: project -> sort -> bin (as forward) -> walk the tiles
// -> sum per row -> pull back the projection.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "engine/render/backward.h"
#include "engine/render/splats.h"

namespace engine::render {

/// SplatGradient of one splat in one tile. In the units of Splat: `along` and `across` are sqrt(log2(e) / 2) times
/// those of SplatGradient.
struct TileGradient {
  float g, along, across;
  float along_along, along_across, across_across;
  float red, green, blue, depth;
  static constexpr std::size_t sums = 10;
};
static_assert(sizeof(TileGradient) == TileGradient::sums * sizeof(float));

/// dL/d(pictures) of one tile, row-major 16 x 16; zero outside the picture.
struct alignas(64) TileUpstream {
  float red[TilePixels::count], green[TilePixels::count], blue[TilePixels::count];
  float depth[TilePixels::count];
  float transmittance[TilePixels::count];  ///< dL/dT behind all: background . color - alpha
};

/// Memory for what a tile's walk keeps from the way to the last blended splat to the way back: per batch of 64 splats a
/// part, and an alpha and a weight per splat and pixel of the blocks it reaches. Kept from tile to tile.
class TileTrace {
 public:
  struct alignas(64) Part {
    std::byte bytes[8 * 1024];
  };
  /// Forgets all alphas and weights; their memory is used again.
  void clear() { slab_ = used_ = 0; }
  /// The i-th part; parts are asked for in order, and stay where they are.
  Part& part(std::size_t i) {
    if (parts_.size() <= i) parts_.push_back(std::make_unique_for_overwrite<Part>());
    return *parts_[i];
  }
  /// Room for n floats, at most slab_size; aligned for vectors where n always is a multiple of their lanes.
  float* floats(std::size_t n) {
    if (used_ + n > slab_size) ++slab_, used_ = 0;
    if (slabs_.size() <= slab_) slabs_.push_back(std::make_unique_for_overwrite<Slab>());
    float* const room = slabs_[slab_]->floats + used_;
    used_ += n;
    return room;
  }
  static constexpr std::size_t slab_size = std::size_t{64} * 1024;

 private:
  struct alignas(64) Slab {
    float floats[slab_size];
  };
  std::vector<std::unique_ptr<Part>> parts_;
  std::vector<std::unique_ptr<Slab>> slabs_;
  std::size_t slab_ = 0, used_ = 0;
};

/// Pulls back one tile.
///   list        splats that reach the tile, nearest first
///   row_slot    [splats] where a splat's row is in the list of rows that may change, or -1
///   with_depth  whether upstream.depth is anything but zero
///   out         [list.size()] written where row_slot is not negative
void composite_tile_vjp(const Splat* splats, std::span<const std::uint32_t> list, const std::int32_t* row_slot, int x0,
                        int y0, const TileUpstream& upstream, bool with_depth, TileTrace& trace, TileGradient* out);

/// Sums over tiles, for the rows [R] that may change. Side by side: they are written in the order of depth.
struct RowGradients {
  Buffer<TileGradient> sums;       ///< [R]
  std::vector<std::uint8_t> seen;  ///< [R] 0: no tile has the row, and its sums are undefined.
};

/// Memory of the tiles that are being walked: as many as there are threads at work. Which one a tile gets changes
/// nothing.
class TracePool {
 public:
  std::unique_ptr<TileTrace> take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return std::make_unique<TileTrace>();
    auto trace = std::move(free_.back());
    free_.pop_back();
    return trace;
  }
  void give_back(std::unique_ptr<TileTrace> trace) {
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(trace));
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<TileTrace>> free_;
};

/// What walk_tiles() works in.
struct WalkBuffers {
  Buffer<std::int32_t> slot_of_splat;  ///< [splats] Where a splat's row is in the list of those that may change, or -1.
  Buffer<TileGradient> entries;        ///< Beside ForwardBuffers::entries.
  std::vector<std::uint8_t> walked;    ///< [tiles] 1: the tile's entries are valid; else they are zero.
  RowGradients rows;
  TracePool traces;
};

/// Upstream by reference; null: zero.
struct UpstreamPlanes {
  const scene::Image* color = nullptr;
  const scene::Image* depth = nullptr;
  const scene::Image* alpha = nullptr;
};

/// Walks all tiles of `forward` back and sums what they find into work.rows.
///   forward   splats, count, entries and tile_begin are used
///   grid      pixels: the rectangle of the picture that `upstream` is of
///   rows      that may change; work.slot_of_splat names their splats
void walk_tiles(const ForwardBuffers& forward, const TileGrid& grid, const UpstreamPlanes& upstream, Vec3 background,
                std::size_t rows, WalkBuffers& work);

void clear_mean2d(Gradients& out);

/// Pulls back projection and colour of the rows [begin, end) of those that may change, and adds to `out`.
///   cloud      that holds these rows: cloud row of rows[r] is rows[r] - first_row
///   sh_degree  bands used
void project_rows_vjp(const scene::GaussianCloud& cloud, std::size_t first_row, const ViewParams<float>& view,
                      int sh_degree, std::span<const std::uint32_t> rows, const RowGradients& v_rows, std::size_t begin,
                      std::size_t end, Gradients& out);

/// Most rows project_rows_vjp() takes at once.
constexpr std::size_t project_vjp_block = 256;

}  // namespace engine::render
