// Blends the splats of one tile, a vector of pixels at a time.
#include <hwy/cache_control.h>
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/composite_simd.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>

#include "engine/render/splats.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, tile_size>;
using V = hn::Vec<D>;

/// 2^x for |x| < 2^21; anything, but no trap, beyond. Relative error below 2e-7.
/// Minimax polynomial of degree 5 on [-1/2, 1/2] (Remez), scaled by 2^round(x) through the exponent bits.
HWY_INLINE V Exp2(D d, V x) {
  const hn::RebindToSigned<D> di;
  const V shift = hn::Set(d, 12582912.0f);  // 1.5 * 2^23: adding it rounds to an integer, held in the low bits
  const V shifted = hn::Add(x, shift);
  const V f = hn::Sub(x, hn::Sub(shifted, shift));
  V p = hn::Set(d, 0.001327647198f);
  p = hn::MulAdd(p, f, hn::Set(d, 0.009675541334f));
  p = hn::MulAdd(p, f, hn::Set(d, 0.05550713274f));
  p = hn::MulAdd(p, f, hn::Set(d, 0.2402211972f));
  p = hn::MulAdd(p, f, hn::Set(d, 0.6931469671f));
  p = hn::MulAdd(p, f, hn::Set(d, 1.000000072f));
  return hn::BitCast(d, hn::Add(hn::BitCast(di, p), hn::ShiftLeft<23>(hn::BitCast(di, shifted))));
}

/// Bit i of the result is lane i of the mask.
HWY_INLINE std::uint64_t Bits(D d, hn::Mask<D> mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  return bytes[0] | std::uint64_t(bytes[1]) << 8;
}

/// A tile is blended in blocks of one vector each, nearly square: a splat wastes fewer lanes at the rim of a square
/// than at the ends of a row (4 x 2 against 8 x 1 saves a fifth of the vectors on a real capture). Pixels of a tile are
/// stored block by block while it is blended.
struct Blocks {
  static constexpr std::size_t lanes = HWY_MIN(hn::MaxLanes(D()), std::size_t(tile_size));
  static constexpr std::size_t width = lanes >= 4 ? 4 : lanes;
  static constexpr std::size_t height = lanes / width;
  static constexpr std::size_t columns = tile_size / width, rows = tile_size / height, count = columns * rows;
  static constexpr std::size_t words = (count + 63) / 64;  // of a set of blocks
};

template <bool kColor, bool kDepth, bool kWeight>
void Blend(const Splat* HWY_RESTRICT splats, const std::uint32_t* HWY_RESTRICT list, std::size_t count, int x0, int y0,
           TilePixels& tile) {
  const D d;
  constexpr std::size_t lanes = Blocks::lanes;
  const V zero = hn::Zero(d);
  for (std::size_t i = 0; i < TilePixels::count; i += lanes) {
    hn::Store(hn::Set(d, 1.0f), d, tile.transmittance + i);
    if constexpr (kColor)
      hn::Store(zero, d, tile.red + i), hn::Store(zero, d, tile.green + i), hn::Store(zero, d, tile.blue + i);
    if constexpr (kDepth) hn::Store(zero, d, tile.depth + i), hn::Store(zero, d, tile.median_depth + i);
    if constexpr (kWeight) hn::Store(zero, d, tile.weight + i);
  }
  std::uint64_t live[Blocks::words];  // blocks in which some ray has not ended
  for (std::size_t w = 0; w < Blocks::words; ++w)
    live[w] = Blocks::count - 64 * w >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << (Blocks::count - 64 * w)) - 1;

  alignas(64) float lane_x[lanes], lane_y[lanes], block_x[Blocks::count], block_y[Blocks::count];
  for (std::size_t i = 0; i < lanes; ++i) lane_x[i] = float(i % Blocks::width), lane_y[i] = float(i / Blocks::width);
  for (std::size_t b = 0; b < Blocks::count; ++b) {
    block_x[b] = float(b % Blocks::columns * Blocks::width);
    block_y[b] = float(b / Blocks::columns * Blocks::height);
  }
  const V threshold = hn::Set(d, -log2_255), ceiling = hn::Set(d, float(max_alpha)),
          floor = hn::Set(d, float(min_transmittance)), sign = hn::Set(d, -0.0f);
  alignas(64) float block_u[Blocks::count], block_v[Blocks::count];
  for (std::size_t k = 0; k < count; ++k) {
    const Splat& splat = splats[list[k]];
    if (k + 4 < count) hwy::Prefetch(&splats[list[k + 4]]);
    // q = u^2 + v^2 with u = l1 dx + l2 dy, v = l3 dy: per block at its first pixel, plus what a lane adds.
    const V l1 = hn::Set(d, splat.l1), l2 = hn::Set(d, splat.l2), l3 = hn::Set(d, splat.l3);
    const V x = hn::Set(d, splat.x - float(x0)), y = hn::Set(d, splat.y - float(y0));  // relative to the tile
    const V lane_u = hn::MulAdd(l1, hn::Load(d, lane_x), hn::Mul(l2, hn::Load(d, lane_y)));
    const V lane_v = hn::Mul(l3, hn::Load(d, lane_y));
    const V log2_opacity = hn::Set(d, splat.log2_opacity);

    // Which blocks can reach alpha 1/255: u and v are linear, so over a block each stays within the interval that its
    // corners span. A little more is let in, so that rounding here never drops a pixel that passes below.
    const V steps_x = hn::Set(d, float(Blocks::width - 1)), steps_y = hn::Set(d, float(Blocks::height - 1));
    const V slant = hn::Mul(l2, steps_y);
    const V low_u = hn::Min(zero, slant), high_u = hn::MulAdd(l1, steps_x, hn::Max(zero, slant));  // l1 > 0
    const V high_v = hn::Mul(l3, steps_y);                                                         // l3 > 0
    const V q_max = hn::Add(log2_opacity, hn::Set(d, log2_255 + 1e-3f));
    std::uint64_t touched[Blocks::words] = {};
    for (std::size_t b = 0; b < Blocks::count; b += lanes) {
      const V dx = hn::Sub(hn::Load(d, block_x + b), x), dy = hn::Sub(hn::Load(d, block_y + b), y);
      const V u = hn::MulAdd(l1, dx, hn::Mul(l2, dy)), v = hn::Mul(l3, dy);
      hn::Store(u, d, block_u + b);
      hn::Store(v, d, block_v + b);
      const V nearest_u = hn::Max(zero, hn::Max(hn::Add(u, low_u), hn::Neg(hn::Add(u, high_u))));
      const V nearest_v = hn::Max(zero, hn::Max(v, hn::Neg(hn::Add(v, high_v))));
      const auto reached = hn::Le(hn::MulAdd(nearest_u, nearest_u, hn::Mul(nearest_v, nearest_v)), q_max);
      touched[b / 64] |= Bits(d, reached) << (b % 64);
    }

    std::uint64_t any_live = 0;
    for (std::size_t word = 0; word < Blocks::words; ++word) {
      std::uint64_t blocks = touched[word] & live[word];
      while (blocks != 0) {
        const std::size_t b = hwy::Num0BitsBelowLS1Bit_Nonzero64(blocks);
        blocks &= blocks - 1;
        const std::size_t block = 64 * word + b, at = block * lanes;
        const V u = hn::Add(hn::Set(d, block_u[block]), lane_u), v = hn::Add(hn::Set(d, block_v[block]), lane_v);
        const V power = hn::NegMulAdd(u, u, hn::NegMulAdd(v, v, log2_opacity));
        const V alpha = hn::IfThenElseZero(hn::Ge(power, threshold), hn::Min(Exp2(d, power), ceiling));
        const V before = hn::Load(d, tile.transmittance + at);
        const V after = hn::NegMulAdd(before, alpha, before);
        const auto going_on =
            hn::Ge(after, floor);  // never true of a ray that has ended: its transmittance is negative
        const V w = hn::IfThenElseZero(going_on, hn::Mul(before, alpha));
        if constexpr (kColor) {
          hn::Store(hn::MulAdd(w, hn::Set(d, splat.red), hn::Load(d, tile.red + at)), d, tile.red + at);
          hn::Store(hn::MulAdd(w, hn::Set(d, splat.green), hn::Load(d, tile.green + at)), d, tile.green + at);
          hn::Store(hn::MulAdd(w, hn::Set(d, splat.blue), hn::Load(d, tile.blue + at)), d, tile.blue + at);
        }
        if constexpr (kDepth) {
          const V z = hn::Set(d, splat.depth), half = hn::Set(d, 0.5f);
          hn::Store(hn::MulAdd(w, z, hn::Load(d, tile.depth + at)), d, tile.depth + at);
          const auto crosses = hn::And(going_on, hn::And(hn::Ge(before, half), hn::Lt(after, half)));
          hn::Store(hn::IfThenElse(crosses, z, hn::Load(d, tile.median_depth + at)), d, tile.median_depth + at);
        }
        if constexpr (kWeight)
          hn::Store(hn::MulAdd(w, hn::Set(d, splat.weight), hn::Load(d, tile.weight + at)), d, tile.weight + at);
        const V next = hn::IfThenElse(going_on, after, hn::Or(before, sign));
        hn::Store(next, d, tile.transmittance + at);
        // No branch here: whether a ray of the block ended just now is as good as random to a predictor.
        live[word] &= ~(std::uint64_t{hn::AllTrue(d, hn::Lt(next, zero))} << b);
      }
      any_live |= live[word];
    }
    if (any_live == 0) return;
  }
}

/// From block order to rows, in place.
void ToRows(float* plane) {
  float blocks[TilePixels::count];
  std::copy_n(plane, TilePixels::count, blocks);
  for (std::size_t b = 0; b < Blocks::count; ++b) {
    float* to = plane + b / Blocks::columns * Blocks::height * tile_size + b % Blocks::columns * Blocks::width;
    const float* from = blocks + b * Blocks::lanes;
    for (std::size_t y = 0; y < Blocks::height; ++y)
      for (std::size_t x = 0; x < Blocks::width; ++x) to[y * tile_size + x] = from[y * Blocks::width + x];
  }
}

template <bool kColor, bool kDepth, bool kWeight>
void Composite(const Splat* splats, const std::uint32_t* list, std::size_t count, int x0, int y0, TilePixels& tile) {
  Blend<kColor, kDepth, kWeight>(splats, list, count, x0, y0, tile);
  ToRows(tile.transmittance);
  if constexpr (kColor) ToRows(tile.red), ToRows(tile.green), ToRows(tile.blue);
  if constexpr (kDepth) ToRows(tile.depth), ToRows(tile.median_depth);
  if constexpr (kWeight) ToRows(tile.weight);
}

void CompositeTile(const Splat* splats, const std::uint32_t* list, std::size_t count, int x0, int y0, Channels channels,
                   TilePixels& tile) {
  if (channels.depth) {
    if (channels.weight) return Composite<true, true, true>(splats, list, count, x0, y0, tile);
    return Composite<true, true, false>(splats, list, count, x0, y0, tile);
  }
  if (channels.weight) {
    if (channels.color) return Composite<true, false, true>(splats, list, count, x0, y0, tile);
    return Composite<false, false, true>(splats, list, count, x0, y0, tile);
  }
  if (channels.color) return Composite<true, false, false>(splats, list, count, x0, y0, tile);
  return Composite<false, false, false>(splats, list, count, x0, y0, tile);
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::render {

HWY_EXPORT(CompositeTile);

void composite_tile(const Splat* splats, std::span<const std::uint32_t> list, int x0, int y0, Channels channels,
                    TilePixels& tile) {
  HWY_DYNAMIC_DISPATCH(CompositeTile)(splats, list.data(), list.size(), x0, y0, channels, tile);
}

}  // namespace engine::render
#endif
