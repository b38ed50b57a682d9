// What the stages of the SIMD forward pass hand to each other: project -> sort -> bin -> composite.
#pragma once

#include <hwy/cache_control.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "engine/render/forward.h"
#include "engine/render/layers.h"
#include "engine/render/project.h"

namespace engine::render {

/// The tiles that a splat's bounding box meets; the ranges include their ends.
struct TileBox {
  std::uint16_t first_column, last_column, first_row, last_row;
};

/// Tiles on a side of a group of tiles. Measured against other sizes in docs/experiments/0014-groups-of-tiles.md.
constexpr int large_tile_group = 3;
/// Tiles on a side of the square groups that are walked back; a splat's gradients are summed over a group before they
/// are stored.
///   rows  number of rows that may change. Groups save memory, which matters where they are many; few rows may lie in
///         tiles that make up too few groups for all threads. See docs/experiments/0014-groups-of-tiles.md
constexpr int tile_group_side(std::size_t rows) { return rows < 20'000 ? 1 : large_tile_group; }

/// Numbers of the pairs of a splat with the groups that its box meets, row by row. They begin anew with each block of
/// splats: ForwardBuffers::pairs_before is to be added.
struct PairsOfSplat {
  std::uint32_t first;    ///< The number that group (0, 0) of the picture would have, modulo 2^32.
  std::uint32_t columns;  ///< Groups that the box meets in a row. 0: the splat may not change.

  [[nodiscard]] bool any() const { return columns != 0; }
  [[nodiscard]] std::uint32_t number(std::uint32_t group_column, std::uint32_t group_row) const {
    return first + group_row * columns + group_column;
  }
};

/// One splat, ready to blend. Its alpha at offset (dx, dy) from the mean, in pixels, is
///   min(0.99, exp2(log2_opacity - (l1 dx + l2 dy)^2 - (l3 dy)^2)),
/// so l1..l3 are those of Projection times sqrt(log2(e) / 2).
struct alignas(64) Splat {
  float x, y;  ///< Mean, pixel-index units.
  float l1, l2, l3;
  float log2_opacity;
  float weight;
  std::uint32_t row;  ///< Row of the Gaussian in its layers.
  // Its colour and depth, in a vector of four of their own: blending copies these as they lie.
  float red, green, blue;
  float depth;  ///< World units along the optical axis.
  TileBox box;
  PairsOfSplat pairs;  ///< None, unless project() is given the rows that may change.
};
static_assert(sizeof(Splat) == 64);  // one cache line: lists take splats from anywhere
static_assert(offsetof(Splat, l3) == 4 * sizeof(float) && offsetof(Splat, red) == 8 * sizeof(float));

/// exp2(log2_opacity - q) >= 1/255 exactly where q <= log2_opacity + log2_255.
constexpr float log2_255 = 7.99435343685886f;

/// Memory that is kept from frame to frame. Elements start uninitialised: the stages fill them, and zeroing or faulting
/// in fresh pages each frame costs as much as a stage.
template <class T>
class Buffer {
  static_assert(std::is_trivially_default_constructible_v<T>);  // or they would not

 public:
  /// Room for n elements; what was in it is lost.
  T* reserve(std::size_t n) {
    if (n > capacity_) {
      data_ = std::make_unique_for_overwrite<T[]>(n);
      capacity_ = n;
    }
    return data_.get();
  }
  /// Room for n elements or more, of which the first `kept` are still there.
  T* grow(std::size_t n, std::size_t kept) {
    if (n <= capacity_) return data_.get();
    n = std::max(n, 2 * capacity_);
    auto larger = std::make_unique_for_overwrite<T[]>(n);
    std::copy_n(data_.get(), kept, larger.get());
    data_ = std::move(larger), capacity_ = n;
    return data_.get();
  }
  [[nodiscard]] T* data() const { return data_.get(); }
  [[nodiscard]] std::size_t capacity() const { return capacity_; }
  T& operator[](std::size_t i) const { return data_[i]; }

 private:
  std::unique_ptr<T[]> data_;
  std::size_t capacity_ = 0;
};

/// The tiles of a picture that are needed, and the pixels that they can reach.
struct TileGrid {
  int columns = 0, rows = 0;         ///< Tiles of the whole picture.
  scene::Rect pixels;                ///< Pixels outside are not needed.
  std::vector<std::uint8_t> wanted;  ///< [rows * columns], or empty: all those that `pixels` meets.
};

/// The ends of the rays of a tile, which blending leaves for the way back. Pixels are in the order in which kernels of
/// the instruction set in use store them.
struct alignas(64) RayEnds {
  static constexpr std::size_t count = std::size_t(tile_size) * tile_size;
  float transmittance[count];  ///< What reaches the background.
  std::int32_t end[count];     ///< One past the last listed splat that its block met and that did not end it. 0: none.
};

/// The key by which a splat is sorted.
struct DepthKey {
  std::uint32_t key;    ///< Bits of the depth: positive floats order as their bits.
  std::uint32_t splat;  ///< Index of the splat.
};

/// The least and the largest of some keys; the other way round for none.
struct KeyRange {
  std::uint32_t least = std::numeric_limits<std::uint32_t>::max(), largest = 0;

  void extend(const KeyRange& other) {
    least = std::min(least, other.least), largest = std::max(largest, other.largest);
  }
};

/// Tiles that splats reach.
struct ReachedTiles {
  std::size_t count = 0;
  Buffer<std::uint32_t> tiles, splats;  ///< [count] A tile, and the index of a splat that reaches it.
  Buffer<std::int32_t> work;            ///< Scratch memory of list_reached_tiles().
};

/// What a forward pass works in. The stages fill it from top to bottom.
struct ForwardBuffers {
  // project: block b of the rows, the base's blocks before those on top, writes its survivors from b * project_block
  // on, and leaves what is left of its room as it is
  Buffer<Splat> splats;
  Buffer<DepthKey> keys;  ///< In the order of `splats`.
  std::vector<std::size_t> block_sizes;
  std::vector<KeyRange> key_ranges;  ///< [blocks]
  // project, if told which rows may change: their pairs with groups of tiles, numbered row by row
  int tile_group = 1;                       ///< Tiles on a side of a group.
  Buffer<std::uint32_t> first_pair;         ///< [rows that may change + 1] The first number of a row.
  std::vector<std::uint32_t> pairs_before;  ///< [blocks + 1] How many pairs the blocks before have; last, all.
  // sort: by depth, ties by row
  std::array<Buffer<DepthKey>, 2> sorted;
  std::span<const DepthKey> by_depth;  ///< All splats, nearest first: one of the two.
  // bin: for each tile the splats that reach it, by depth
  struct BinBlock {
    ReachedTiles reached;
    /// Per tile: the block's count of entries, then how many of blocks before it there are, then where its next one
    /// goes.
    std::vector<std::uint32_t> position;
  };
  std::vector<BinBlock> bin_blocks;
  Buffer<std::uint32_t> entries;          ///< Indices into splats.
  std::vector<std::uint32_t> tile_begin;  ///< [tiles + 1] into entries.
  // composite, if it is to be walked back
  Buffer<RayEnds> ray_ends;  ///< [tiles]
};

/// The memory behind a Workspace.
struct Workspace::Impl {
  ForwardBuffers buffers;
};

/// One cloud on its way through projection.
struct ProjectedLayer {
  const scene::GaussianCloud& cloud;
  std::span<const std::uint32_t> hidden;  ///< Rows left out, ascending.
  std::size_t first_row;                  ///< What Splat::row is of its row 0.
  const float* weight;                    ///< [N] or null
};

/// How to find out that a Gaussian reaches no wanted pixel. The survivors are the same.
enum class Culling {
  exact,    ///< Once it is projected.
  by_bound  ///< From a bound on its extent first: pays where most of what is in front of the camera is elsewhere.
};

/// Projects the rows [begin, end) and writes those that can be seen within `pixels` to `out`, in row order.
///   sh_degree  bands used; -1: colours are not needed
///   out        room for end - begin
///   returns    how many were written
std::size_t project_rows(const ProjectedLayer& layer, const ViewParams<float>& view, int sh_degree, Culling culling,
                         scene::Rect pixels, std::size_t begin, std::size_t end, Splat* out);

/// Most rows project_rows() takes at once.
constexpr std::size_t project_block = 1024;

/// A tile of a picture: its first pixel, and how many pixels from there on are shown.
struct TilePlace {
  int x0, y0;
  int width, height;  ///< At most tile_size.
};

///   columns  tiles across the whole picture
///   shown    pixels of it
inline TilePlace place_of(std::size_t tile, int columns, scene::Rect shown) {
  const int x0 = int(tile) % columns * tile_size, y0 = int(tile) / columns * tile_size;
  return {x0, y0, std::min(tile_size, shown.x1 - x0), std::min(tile_size, shown.y1 - y0)};
}

/// The part of the tile whose first pixel is (x0, y0) that lies within `area`, from that pixel on. Empty if none does.
inline scene::Rect part_of_tile(int x0, int y0, scene::Rect area) {
  return {std::max(area.x0 - x0, 0), std::max(area.y0 - y0, 0), std::min(area.x1 - x0, tile_size),
          std::min(area.y1 - y0, tile_size)};
}
constexpr scene::Rect whole_tile{0, 0, tile_size, tile_size};

/// The offset of pixel (x, y) of the whole picture in a plane that holds `area` of it.
inline std::ptrdiff_t place_in(scene::Rect area, int x, int y) {
  return std::ptrdiff_t(y - area.y0) * area.width() + (x - area.x0);
}

/// The pixels that a picture is asked for.
inline scene::Rect rect_of(const ForwardOptions& options, const scene::Camera& camera) {
  return options.rect.value_or(scene::Rect{0, 0, camera.width, camera.height});
}

/// The sums that composite_tile() keeps.
struct Channels {
  bool color = false, depth = false, weight = false;
};

/// The pixels of one tile, in the order in which kernels of the instruction set in use store them: copy_tile_plane()
/// knows it.
struct alignas(64) TilePixels {
  static constexpr std::size_t count = std::size_t(tile_size) * tile_size;
  // while blending
  float transmittance[count];  ///< What reaches the next splat; less than min_transmittance once the ray has ended.
  float left[count];           ///< What reaches the background.
  // what a picture shows
  float alpha[count];
  float red[count], green[count], blue[count];
  float depth[count], median_depth[count];
  float weight[count];
};

/// Asks for the pixels of a picture that a tile is to be copied from, or to, while there is other work to do: its rows
/// lie far apart, and each would be waited for.
///   at      first pixel of the tile's first row
///   stride  floats from row to row
inline void fetch_tile(const float* at, std::ptrdiff_t stride, int width, int height) {
  for (int y = 0; y < height; ++y) {
    hwy::Prefetch(at + y * stride);
    hwy::Prefetch(at + y * stride + width - 1);
  }
}

/// Blends the listed splats, nearest first, into the tile, and the background behind them. Only the planes that
/// `channels` names, and alpha, are written, and of those only the pixels that are shown mean something.
///   ends  null: not needed. Else channels are colour or none.
void composite_tile(const Splat* splats, std::span<const std::uint32_t> list, TilePlace place, Channels channels,
                    Vec3 background, TilePixels& tile, RayEnds* ends = nullptr);

/// Copies some of the pixels of a plane of TilePixels to a picture.
///   part    of the tile, whose first pixel is (0, 0)
///   to      where the part's first pixel goes
///   stride  floats from row to row
void copy_tile_plane(const float* plane, scene::Rect part, float* to, std::ptrdiff_t stride);

/// The largest blending weight of each listed splat over the pixels of a tile; see composite_tile().
/// Pixels that are not shown count for nothing.
///   out  [list.size()]
void largest_tile_weights(const Splat* splats, std::span<const std::uint32_t> list, TilePlace place, float* out);

/// The sums of each listed splat's blending weights over the pixels of a tile, and of weight times value.
/// Pixels that are not shown count for nothing.
///   value        [tile_size][tile_size] of the tile's pixels, row by row
///   all, valued  [list.size()]
void sum_tile_weights(const Splat* splats, std::span<const std::uint32_t> list, TilePlace place, const float* value,
                      float* all, float* valued);

/// Projects all layers into the buffers.
///   weight  [layers.size()] or empty
void project(const Layers& layers, const ViewParams<float>& view, int sh_degree, std::span<const float> weight,
             Culling culling, scene::Rect pixels, ForwardBuffers& buffers);
/// The same for pictures that are differentiated.
///   changeable  [R] rows that may change, ascending
void project(const Layers& layers, const ViewParams<float>& view, int sh_degree, scene::Rect pixels,
             std::span<const std::uint32_t> changeable, ForwardBuffers& buffers);

/// Lists the tiles of splats' boxes that hold a pixel within their reach (and rarely one that just misses): splat by
/// splat and, of each, row by row.
///   order    which splats
///   columns  tiles across the picture
///   out      written over; its memory is kept
void list_reached_tiles(const Splat* splats, std::span<const DepthKey> order, int columns, ReachedTiles& out);

/// The stages between projection and blending: an order of the splats, and lists of them, where they lie.
void sort_by_depth(ForwardBuffers& buffers);
void bin(const TileGrid& grid, ForwardBuffers& buffers);

}  // namespace engine::render
