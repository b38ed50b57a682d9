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
  // Estrin's order: half the latency of Horner's, for one multiplication more.
  const V f2 = hn::Mul(f, f);
  const V high = hn::MulAdd(hn::Set(d, 0.001327647198f), f, hn::Set(d, 0.009675541334f));
  const V middle = hn::MulAdd(hn::Set(d, 0.05550713274f), f, hn::Set(d, 0.2402211972f));
  const V low = hn::MulAdd(hn::Set(d, 0.6931469671f), f, hn::Set(d, 1.000000072f));
  const V p = hn::MulAdd(hn::MulAdd(high, f2, middle), f2, low);
  return hn::BitCast(d, hn::Add(hn::BitCast(di, p), hn::ShiftLeft<23>(hn::BitCast(di, shifted))));
}

/// A tile is blended in blocks of one vector each, nearly square: a splat wastes fewer lanes at the rim of a square
/// than at the ends of a row (4 x 2 against 8 x 1 saves a fifth of the vectors on a real capture). Pixels of a tile are
/// stored block by block while it is blended.
struct Blocks {
  static constexpr std::size_t lanes = HWY_MIN(hn::MaxLanes(D()), std::size_t(tile_size));
  static constexpr std::size_t width = lanes >= 4 ? 4 : lanes;
  static constexpr std::size_t height = lanes / width;
  static constexpr std::size_t columns = tile_size / width, rows = tile_size / height, count = columns * rows;
};

/// Splats are taken in batches, in two phases: first which blocks each reaches, then the blending, one long loop over
/// all (splat, block) pairs of the batch. Nested loops would end unpredictably after some ten blocks per splat, and
/// each time lay bare the latency of finding the next splat's blocks: nearly half of the time.
struct Batch {
  static constexpr std::size_t size = 32;
  // q = u^2 + v^2 with u = l1 dx + l2 dy, v = l3 dy: at a block's first pixel, plus what each lane adds.
  alignas(64) float block_u[size * Blocks::count], block_v[size * Blocks::count];
  alignas(64) float lane_u[size * Blocks::lanes], lane_v[size * Blocks::lanes];
  const Splat* splat[size];
  std::size_t pairs = 0;
  std::uint16_t pair[size * Blocks::count + 8];  ///< slot * Blocks::count + block, in blending order.
};

/// The positions of the set bits of a byte, in order; what follows them is overwritten by the next byte's.
struct BitPositions {
  std::uint16_t of[256][8] = {};
  constexpr BitPositions() {
    for (unsigned byte = 0; byte < 256; ++byte)
      for (unsigned bit = 0, n = 0; bit < 8; ++bit)
        if ((byte >> bit & 1) != 0) of[byte][n++] = std::uint16_t(bit);
  }
};
constexpr BitPositions bit_positions;

/// Where the blocks of a tile are, and which of them still have a ray that has not ended.
struct TileBlocks {
  alignas(64) float x[Blocks::count], y[Blocks::count];            // first pixel, relative to the tile
  alignas(64) float lane_x[Blocks::lanes], lane_y[Blocks::lanes];  // of a lane, relative to its block
  std::uint8_t live[(Blocks::count + 7) / 8];                      // a bit per block

  TileBlocks() {
    for (std::size_t b = 0; b < Blocks::count; ++b) {
      x[b] = float(b % Blocks::columns * Blocks::width);
      y[b] = float(b / Blocks::columns * Blocks::height);
    }
    for (std::size_t i = 0; i < Blocks::lanes; ++i) {
      lane_x[i] = float(i % Blocks::width);
      lane_y[i] = float(i / Blocks::width);
    }
    std::fill(std::begin(live), std::end(live), std::uint8_t{0xff});
  }
};

/// Puts a splat into a slot of the batch: its blocks that can reach alpha 1/255 join the pairs.
/// u and v are linear, so over a block each stays within the interval that the block's corners span. A little more is
/// let in, so that rounding here never drops a pixel that passes in the blending.
HWY_INLINE void Reach(D d, const Splat& splat, std::size_t slot, int x0, int y0, const TileBlocks& tile, Batch& batch) {
  constexpr std::size_t lanes = Blocks::lanes;
  const V zero = hn::Zero(d);
  const V l1 = hn::Set(d, splat.l1), l2 = hn::Set(d, splat.l2), l3 = hn::Set(d, splat.l3);
  const V x = hn::Set(d, splat.x - float(x0)), y = hn::Set(d, splat.y - float(y0));
  const V lane_x = hn::Load(d, tile.lane_x), lane_y = hn::Load(d, tile.lane_y);
  hn::Store(hn::MulAdd(l1, lane_x, hn::Mul(l2, lane_y)), d, batch.lane_u + slot * lanes);
  hn::Store(hn::Mul(l3, lane_y), d, batch.lane_v + slot * lanes);
  batch.splat[slot] = &splat;

  const V steps_x = hn::Set(d, float(Blocks::width - 1)), steps_y = hn::Set(d, float(Blocks::height - 1));
  const V slant = hn::Mul(l2, steps_y);
  const V low_u = hn::Min(zero, slant), high_u = hn::MulAdd(l1, steps_x, hn::Max(zero, slant));  // l1 > 0
  const V high_v = hn::Mul(l3, steps_y);                                                         // l3 > 0
  const V q_max = hn::Set(d, splat.log2_opacity + (log2_255 + 1e-3f));
  std::uint8_t reached[sizeof tile.live + 8] = {};
  for (std::size_t b = 0; b < Blocks::count; b += lanes) {
    const V dx = hn::Sub(hn::Load(d, tile.x + b), x), dy = hn::Sub(hn::Load(d, tile.y + b), y);
    const V u = hn::MulAdd(l1, dx, hn::Mul(l2, dy)), v = hn::Mul(l3, dy);
    hn::Store(u, d, batch.block_u + slot * Blocks::count + b);
    hn::Store(v, d, batch.block_v + slot * Blocks::count + b);
    const V nearest_u = hn::Max(zero, hn::Max(hn::Add(u, low_u), hn::Neg(hn::Add(u, high_u))));
    const V nearest_v = hn::Max(zero, hn::Max(v, hn::Neg(hn::Add(v, high_v))));
    const auto inside = hn::Le(hn::MulAdd(nearest_u, nearest_u, hn::Mul(nearest_v, nearest_v)), q_max);
    if constexpr (lanes >= 8) {
      hn::StoreMaskBits(d, inside, reached + b / 8);
    } else {
      std::uint8_t bits[8] = {};
      hn::StoreMaskBits(d, inside, bits);
      reached[b / 8] = std::uint8_t(reached[b / 8] | bits[0] << (b % 8));
    }
  }
  for (std::size_t byte = 0; byte < sizeof tile.live; ++byte) {
    const std::uint8_t bits = reached[byte] & tile.live[byte];
    const auto first = std::uint16_t(slot * Blocks::count + 8 * byte);
    std::uint16_t* out = batch.pair + batch.pairs;
    for (std::size_t i = 0; i < 8; ++i) out[i] = std::uint16_t(first + bit_positions.of[bits][i]);
    batch.pairs += hwy::PopCount(std::uint64_t{bits});
  }
}

template <bool kColor, bool kDepth, bool kWeight>
HWY_INLINE void Blend(D d, const Batch& batch, TilePixels& tile) {
  constexpr std::size_t lanes = Blocks::lanes;
  const V threshold = hn::Set(d, -log2_255), ceiling = hn::Set(d, float(max_alpha)),
          floor = hn::Set(d, float(min_transmittance)), sign = hn::Set(d, -0.0f);
  const std::size_t pairs = batch.pairs;
  for (std::size_t i = 0; i < pairs; ++i) {
    const std::size_t pair = batch.pair[i], slot = pair / Blocks::count, at = pair % Blocks::count * lanes;
    const Splat& splat = *batch.splat[slot];
    const V u = hn::Add(hn::Set(d, batch.block_u[pair]), hn::Load(d, batch.lane_u + slot * lanes));
    const V v = hn::Add(hn::Set(d, batch.block_v[pair]), hn::Load(d, batch.lane_v + slot * lanes));
    const V power = hn::NegMulAdd(u, u, hn::NegMulAdd(v, v, hn::Set(d, splat.log2_opacity)));
    const V alpha = hn::IfThenElseZero(hn::Ge(power, threshold), hn::Min(Exp2(d, power), ceiling));  // from 1/255 on
    const V before = hn::Load(d, tile.transmittance + at);
    const V after = hn::NegMulAdd(before, alpha, before);
    const auto going_on = hn::Ge(after, floor);  // never true of a ray that has ended: its transmittance is negative
    const V w = hn::IfThenElseZero(going_on, hn::Mul(before, alpha));
    hn::Store(hn::IfThenElse(going_on, after, hn::Or(before, sign)), d, tile.transmittance + at);
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
  }
}

/// Notes which blocks have a ray that has not ended; false if none has.
bool UpdateLive(D d, const TilePixels& pixels, TileBlocks& tile) {
  bool any = false;
  std::fill(std::begin(tile.live), std::end(tile.live), std::uint8_t{0});
  for (std::size_t b = 0; b < Blocks::count; ++b) {
    const V transmittance = hn::Load(d, pixels.transmittance + b * Blocks::lanes);
    const bool live = !hn::AllTrue(d, hn::Lt(transmittance, hn::Zero(d)));
    tile.live[b / 8] = std::uint8_t(tile.live[b / 8] | unsigned{live} << (b % 8));
    any |= live;
  }
  return any;
}

template <bool kColor, bool kDepth, bool kWeight>
void BlendTile(const Splat* splats, const std::uint32_t* list, std::size_t count, int x0, int y0, TilePixels& pixels) {
  const D d;
  const V zero = hn::Zero(d);
  for (std::size_t i = 0; i < TilePixels::count; i += Blocks::lanes) {
    hn::Store(hn::Set(d, 1.0f), d, pixels.transmittance + i);
    if constexpr (kColor) {
      hn::Store(zero, d, pixels.red + i);
      hn::Store(zero, d, pixels.green + i);
      hn::Store(zero, d, pixels.blue + i);
    }
    if constexpr (kDepth) hn::Store(zero, d, pixels.depth + i), hn::Store(zero, d, pixels.median_depth + i);
    if constexpr (kWeight) hn::Store(zero, d, pixels.weight + i);
  }
  TileBlocks tile;
  Batch batch;
  for (std::size_t first = 0; first < count; first += Batch::size) {
    const std::size_t last = HWY_MIN(first + Batch::size, count);
    batch.pairs = 0;
    for (std::size_t k = first; k < last; ++k) Reach(d, splats[list[k]], k - first, x0, y0, tile, batch);
    for (std::size_t k = last; k < HWY_MIN(last + Batch::size, count); ++k) hwy::Prefetch(&splats[list[k]]);
    Blend<kColor, kDepth, kWeight>(d, batch, pixels);
    if (!UpdateLive(d, pixels, tile)) return;
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
  BlendTile<kColor, kDepth, kWeight>(splats, list, count, x0, y0, tile);
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
