// Which tiles splats reach, a vector of splats at a time.
#include <hwy/cache_control.h>
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/simd/reached_tiles.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <numeric>

#include "engine/render/splats.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using TileD = hn::ScalableTag<float>;
using TileV = hn::Vec<TileD>;

/// The ellipses q <= q_max of a vector of splats, for asking where each lies within a band of pixel rows.
struct Ellipses {
  TileV x, y, slope, half_y, inverse_half_y, radius_over_l1, rightmost_dy, margin;

  HWY_INLINE Ellipses(TileD d, TileV mean_x, TileV mean_y, TileV l1, TileV l2, TileV l3, TileV log2_opacity)
      : x(mean_x), y(mean_y) {
    const TileV one = hn::Set(d, 1.0f);
    // u = l1 dx + l2 dy and v = l3 dy run over a disc of this radius. A little more is let in, for rounding here and in
    // the blend.
    const TileV radius = hn::Sqrt(hn::Max(hn::Zero(d), hn::Add(log2_opacity, hn::Set(d, log2_255 + 1e-3f))));
    const TileV inverse_l1 = hn::Div(one, l1);
    slope = hn::Neg(hn::Mul(l2, inverse_l1));
    half_y = hn::Div(radius, l3);
    inverse_half_y = hn::Div(l3, radius);
    radius_over_l1 = hn::Mul(radius, inverse_l1);
    const TileV tilt = hn::Div(l2, l3);
    rightmost_dy = hn::Neg(hn::Mul(hn::Div(tilt, hn::Sqrt(hn::MulAdd(tilt, tilt, one))), half_y));
    margin = hn::MulAdd(hn::Set(d, 1e-5f), hn::MulAdd(hn::Abs(slope), half_y, radius_over_l1), hn::Set(d, 0.01f));
  }

  HWY_INLINE Ellipses() = default;

  /// In each lane the ellipse of another.
  template <class Indices>
  HWY_INLINE Ellipses Of(Indices who) const {
    const auto of = [&](TileV v) { return hn::TableLookupLanes(v, who); };
    Ellipses out;
    out.x = of(x), out.y = of(y), out.slope = of(slope), out.half_y = of(half_y);
    out.inverse_half_y = of(inverse_half_y), out.radius_over_l1 = of(radius_over_l1);
    out.rightmost_dy = of(rightmost_dy), out.margin = of(margin);
    return out;
  }

  /// x of the right edge at height dy, relative to the mean; concave in dy. The left edge is its point reflection.
  HWY_INLINE TileV Reach(TileD d, TileV dy) const {
    const TileV t = hn::Mul(dy, inverse_half_y);
    const TileV half = hn::Sqrt(hn::Max(hn::Zero(d), hn::NegMulAdd(t, t, hn::Set(d, 1.0f))));
    return hn::Add(hn::MulAdd(slope, dy, hn::Mul(radius_over_l1, half)), margin);
  }

  /// Smallest and largest x over the pixel rows [row0, row1].
  HWY_INLINE void OverRows(TileD d, TileV row0, TileV row1, TileV& left, TileV& right) const {
    const auto within = [](TileV v, TileV low, TileV high) { return hn::Min(hn::Max(v, low), high); };
    const TileV low = within(hn::Sub(row0, y), hn::Neg(half_y), half_y),
                high = within(hn::Sub(row1, y), hn::Neg(half_y), half_y);
    left = hn::Sub(x, Reach(d, within(rightmost_dy, hn::Neg(high), hn::Neg(low))));
    right = hn::Add(x, Reach(d, within(rightmost_dy, low, high)));
  }
};

/// A vector of splats and the boxes of tiles that they meet, one array per value.
struct alignas(64) BoxedSplats {
  static constexpr std::size_t room = hn::MaxLanes(TileD());
  float x[room], y[room], l1[room], l2[room], l3[room], log2_opacity[room];
  float left[room], right[room];  ///< First and last pixel column of the box.
  std::int32_t first_row[room], rows[room];
};

/// Takes n splats, and returns how many tiles their boxes have. What fills up the last vector: the last one once more.
HWY_INLINE std::size_t Take(const Splat* splats, const DepthKey* order, std::size_t n, BoxedSplats& to) {
  std::size_t tiles = 0;
  for (std::size_t k = 0; k < BoxedSplats::room; ++k) {
    const Splat& splat = splats[order[HWY_MIN(k, n - 1)].splat];
    const TileBox& box = splat.box;
    to.x[k] = splat.x, to.y[k] = splat.y, to.l1[k] = splat.l1, to.l2[k] = splat.l2, to.l3[k] = splat.l3;
    to.log2_opacity[k] = splat.log2_opacity;
    to.left[k] = float(box.first_column * tile_size), to.right[k] = float((box.last_column + 1) * tile_size - 1);
    to.first_row[k] = box.first_row, to.rows[k] = box.last_row - box.first_row + 1;
    if (k < n) tiles += std::size_t(box.last_column - box.first_column + 1) * std::size_t(to.rows[k]);
  }
  return tiles;
}

/// Writes first, first + 1, ... and n times `same`, in whole vectors, and one at least: mostly there are few, and what
/// is too much, up to a vector, is written over by what comes next.
template <class DI>
HWY_INLINE void WriteRun(DI di, std::size_t n, hn::TFromD<DI> first, hn::TFromD<DI> same, hn::TFromD<DI>* counted,
                         hn::TFromD<DI>* repeated) {
  for (std::size_t i = 0; i == 0 || i < n; i += hn::Lanes(di)) {
    hn::StoreU(hn::Add(hn::Iota(di, 0), hn::Set(di, first + hn::TFromD<DI>(i))), di, counted + i);
    hn::StoreU(hn::Set(di, same), di, repeated + i);
  }
}

/// Splats that are asked for before they are needed, since they lie anywhere.
constexpr std::size_t fetch_ahead = 32;

void ListReachedTiles(const Splat* splats, const DepthKey* order, std::size_t n, int columns, ReachedTiles& out) {
  const TileD d;
  const hn::RebindToSigned<TileD> di;
  const hn::CappedTag<std::uint32_t, 8> d_tiles;  // whole vectors are written, past the end, too
  const std::size_t lanes = hn::Lanes(d);
  BoxedSplats boxed;
  std::size_t end = 0;
  for (std::size_t i = 0; i < n; i += lanes) {
    const std::size_t here = HWY_MIN(lanes, n - i);
    for (std::size_t k = i + fetch_ahead; k < HWY_MIN(i + fetch_ahead + lanes, n); ++k)
      hwy::Prefetch(&splats[order[k].splat]);
    const std::size_t room_needed = end + Take(splats, order + i, here, boxed) + hn::Lanes(d_tiles);
    std::uint32_t* const tiles = out.tiles.grow(room_needed, end);
    std::uint32_t* const listed = out.splats.grow(room_needed, end);
    const Ellipses ellipses(d, hn::Load(d, boxed.x), hn::Load(d, boxed.y), hn::Load(d, boxed.l1), hn::Load(d, boxed.l2),
                            hn::Load(d, boxed.l3), hn::Load(d, boxed.log2_opacity));
    const TileV box_left = hn::Load(d, boxed.left), box_right = hn::Load(d, boxed.right);

    // The rows of tiles of all boxes, one after the other, so that large boxes and small ones fill the same vectors.
    const auto all_rows = std::size_t(std::accumulate(boxed.rows, boxed.rows + here, std::int64_t{0}));
    const std::size_t room = all_rows + lanes;
    std::int32_t* const row_of = out.work.reserve(3 * room);
    std::int32_t* const owner = row_of + room;  // 0 to lanes - 1
    std::int32_t* const count = owner + room;
    std::size_t written = 0;
    for (std::size_t k = 0; k < here; ++k) {
      const auto rows = std::size_t(boxed.rows[k]);
      WriteRun(di, rows, boxed.first_row[k], std::int32_t(k), row_of + written, owner + written);
      written += rows;
    }
    hn::StoreU(hn::Zero(di), di, owner + written);  // of what fills up the last vector

    // In a row, the tiles that are reached lie side by side: the first of them, in place of the row, and how many.
    std::int32_t* const first = row_of;
    for (std::size_t at = 0; at < written; at += lanes) {
      const auto who = hn::SetTableIndices(d, owner + at);
      const auto tile_row = hn::LoadU(di, row_of + at);
      const TileV top = hn::Mul(hn::ConvertTo(d, tile_row), hn::Set(d, float(tile_size)));
      TileV left, right;
      ellipses.Of(who).OverRows(d, top, hn::Add(top, hn::Set(d, float(tile_size - 1))), left, right);
      // Tile tx holds the pixel centres 16 tx to 16 tx + 15. What lies beyond any int is beyond the box, too: there is
      // none, and what it is converted to does not matter.
      left = hn::Max(left, hn::TableLookupLanes(box_left, who));
      right = hn::Min(right, hn::TableLookupLanes(box_right, who));
      const auto any = hn::RebindMask(di, hn::Le(left, right));
      const auto begin = hn::ShiftRight<log2_tile_size>(hn::ConvertTo(di, hn::Ceil(left)));
      const auto last = hn::ShiftRight<log2_tile_size>(hn::ConvertTo(di, right));
      hn::StoreU(hn::Add(hn::Mul(tile_row, hn::Set(di, columns)), begin), di, first + at);
      hn::StoreU(hn::IfThenElseZero(any, hn::Add(hn::Sub(last, begin), hn::Set(di, 1))), di, count + at);
    }
    for (std::size_t at = 0; at < written; ++at) {
      const auto run = std::size_t(count[at]);
      WriteRun(d_tiles, run, std::uint32_t(first[at]), order[i + std::size_t(owner[at])].splat, tiles + end,
               listed + end);
      end += run;
    }
  }
  out.count = end;
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::render {

HWY_EXPORT(ListReachedTiles);

void list_reached_tiles(const Splat* splats, std::span<const DepthKey> order, int columns, ReachedTiles& out) {
  HWY_DYNAMIC_DISPATCH(ListReachedTiles)(splats, order.data(), order.size(), columns, out);
}

}  // namespace engine::render
#endif
