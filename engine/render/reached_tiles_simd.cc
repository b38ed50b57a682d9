// Which tiles splats reach, a vector of splats at a time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/reached_tiles_simd.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>

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

/// Some splats and the boxes of tiles they meet, one array per value.
struct alignas(64) BoxedSplats {
  static constexpr std::size_t room = hn::MaxLanes(TileD());
  float x[room], y[room], l1[room], l2[room], l3[room], log2_opacity[room];
  float left[room], right[room];  ///< First and last pixel column of the box.
  std::int32_t first_row[room], rows[room];
};

/// Takes n splats. What fills up the last vector: the last one once more.
HWY_INLINE void Take(const Splat* splats, const TileBox* boxes, std::size_t n, BoxedSplats& to) {
  for (std::size_t k = 0; k < BoxedSplats::room; ++k) {
    const Splat& splat = splats[HWY_MIN(k, n - 1)];
    const TileBox& box = boxes[HWY_MIN(k, n - 1)];
    to.x[k] = splat.x, to.y[k] = splat.y, to.l1[k] = splat.l1, to.l2[k] = splat.l2, to.l3[k] = splat.l3;
    to.log2_opacity[k] = splat.log2_opacity;
    to.left[k] = float(box.first_column * tile_size), to.right[k] = float((box.last_column + 1) * tile_size - 1);
    to.first_row[k] = box.first_row, to.rows[k] = box.last_row - box.first_row + 1;
  }
}

std::uint32_t* ListReachedTiles(const Splat* splats, const TileBox* boxes, std::size_t n, int columns,
                                Buffer<std::int32_t>& work, std::uint32_t* tiles, std::uint32_t* reached) {
  const TileD d;
  const hn::RebindToSigned<TileD> di;
  const hn::CappedTag<std::uint32_t, reached_tiles_slack> d_tiles;
  const std::size_t lanes = hn::Lanes(d);
  const auto side_by_side = hn::Iota(d_tiles, 0);
  BoxedSplats boxed;
  for (std::size_t i = 0; i < n; i += lanes) {
    const std::size_t here = HWY_MIN(lanes, n - i);
    Take(splats + i, boxes + i, here, boxed);
    const Ellipses ellipses(d, hn::Load(d, boxed.x), hn::Load(d, boxed.y), hn::Load(d, boxed.l1), hn::Load(d, boxed.l2),
                            hn::Load(d, boxed.l3), hn::Load(d, boxed.log2_opacity));
    const TileV box_left = hn::Load(d, boxed.left), box_right = hn::Load(d, boxed.right);
    const auto first_row = hn::Load(di, boxed.first_row), rows = hn::Load(di, boxed.rows);
    // Row by row of tiles, those that are reached lie side by side: the first of them, and how many.
    const int most_rows = *std::max_element(boxed.rows, boxed.rows + lanes);
    std::int32_t* const first = work.reserve(2 * std::size_t(most_rows) * lanes);
    std::int32_t* const count = first + std::size_t(most_rows) * lanes;
    for (int row = 0; row < most_rows; ++row) {
      const auto tile_row = hn::Add(first_row, hn::Set(di, row));
      const TileV top = hn::Mul(hn::ConvertTo(d, tile_row), hn::Set(d, float(tile_size)));
      TileV left, right;
      ellipses.OverRows(d, top, hn::Add(top, hn::Set(d, float(tile_size - 1))), left, right);
      // Tile tx holds the pixel centres 16 tx to 16 tx + 15. What lies beyond any int is beyond the box, too: there is
      // none, and what it is converted to does not matter.
      left = hn::Max(left, box_left), right = hn::Min(right, box_right);
      const auto any = hn::And(hn::Lt(hn::Set(di, row), rows), hn::RebindMask(di, hn::Le(left, right)));
      const auto begin = hn::ShiftRight<log2_tile_size>(hn::ConvertTo(di, hn::Ceil(left)));
      const auto end = hn::Add(hn::ShiftRight<log2_tile_size>(hn::ConvertTo(di, right)), hn::Set(di, 1));
      const std::size_t at = std::size_t(row) * lanes;
      hn::StoreU(hn::Add(hn::Mul(tile_row, hn::Set(di, columns)), begin), di, first + at);
      hn::StoreU(hn::IfThenElseZero(any, hn::Sub(end, begin)), di, count + at);
    }
    for (std::size_t k = 0; k < here; ++k) {
      std::uint32_t* const before = tiles;
      for (std::size_t row = 0, at = k; row < std::size_t(boxed.rows[k]); ++row, at += lanes) {
        // Mostly there are few: a vector is written in any case, and what is too much is written over.
        const auto n_tiles = std::size_t(count[at]);
        for (std::size_t t = 0; t == 0 || t < n_tiles; t += hn::Lanes(d_tiles))
          hn::StoreU(hn::Add(side_by_side, hn::Set(d_tiles, std::uint32_t(first[at]) + std::uint32_t(t))), d_tiles,
                     tiles + t);
        tiles += n_tiles;
      }
      *reached++ = std::uint32_t(tiles - before);
    }
  }
  return tiles;
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::render {

HWY_EXPORT(ListReachedTiles);

std::uint32_t* list_reached_tiles(std::span<const Splat> splats, const TileBox* boxes, int columns,
                                  Buffer<std::int32_t>& work, std::uint32_t* tiles, std::uint32_t* reached) {
  return HWY_DYNAMIC_DISPATCH(ListReachedTiles)(splats.data(), boxes, splats.size(), columns, work, tiles, reached);
}

}  // namespace engine::render
#endif
