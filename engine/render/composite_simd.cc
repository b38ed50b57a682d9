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

/// Bit i of the result is lane i of the mask.
HWY_INLINE std::uint64_t Bits(D d, hn::Mask<D> mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  return bytes[0] | std::uint64_t{bytes[1]} << 8;
}

/// A tile is blended in blocks of one vector each, nearly square: a splat wastes fewer lanes at the rim of a square
/// than at the ends of a row (4 x 2 against 8 x 1 saves a sixth of the vectors on a real capture). Pixels of a tile are
/// stored block by block while it is blended.
struct Blocks {
  static constexpr std::size_t lanes = HWY_MIN(hn::MaxLanes(D()), std::size_t(tile_size));
  static constexpr std::size_t width = lanes >= 4 ? 4 : lanes;
  static constexpr std::size_t height = lanes / width;
  static constexpr std::size_t columns = tile_size / width, rows = tile_size / height, count = columns * rows;
};

/// Splats are taken in batches, in two phases: first which blocks each reaches, then, block by block, the blending of
/// all that reach it, with the block's pixels in registers, so that no step loads or stores one (docs/adr/0001 has what
/// that and its alternatives cost).
struct Batch {
  static constexpr std::size_t size = 64;
  // One value per splat. At pixel (px, py) of the tile: q = u^2 + v^2, u = l1 px + l2 py + u0, v = l3 py + v0.
  alignas(64) float l1[size], l2[size], l3[size], u0[size], v0[size], log2_opacity[size];
  alignas(64) float red[size], green[size], blue[size], depth[size], weight[size];
  std::uint64_t reach[Blocks::count];  ///< Bit k: splat k can come to alpha 1/255 within the block.
};

/// Loads n splats, in the coordinates of the tile whose first pixel is (x0, y0).
HWY_INLINE void Fill(const Splat* splats, const std::uint32_t* list, std::size_t n, int x0, int y0, Batch& batch) {
  for (std::size_t k = 0; k < n; ++k) {
    const Splat& splat = splats[list[k]];
    const float x = splat.x - float(x0), y = splat.y - float(y0);
    batch.l1[k] = splat.l1, batch.l2[k] = splat.l2, batch.l3[k] = splat.l3;
    batch.u0[k] = -(splat.l1 * x + splat.l2 * y);
    batch.v0[k] = -splat.l3 * y;
    batch.log2_opacity[k] = splat.log2_opacity;
    batch.red[k] = splat.red, batch.green[k] = splat.green, batch.blue[k] = splat.blue;
    batch.depth[k] = splat.depth, batch.weight[k] = splat.weight;
  }
  for (std::size_t k = n; k % Blocks::lanes != 0; ++k) {  // what fills up the last vector reaches nothing
    batch.l1[k] = batch.l2[k] = batch.l3[k] = batch.u0[k] = batch.v0[k] = 0;
    batch.log2_opacity[k] = -1e30f;
  }
}

/// Which blocks the n splats of the batch reach. u and v are linear, so over a block each stays within the interval
/// that the block's corners span. A little more is let in, so that rounding here never drops a pixel that passes in
/// Blend().
HWY_INLINE void FindReach(D d, std::size_t n, Batch& batch) {
  std::fill(std::begin(batch.reach), std::end(batch.reach), std::uint64_t{0});
  const V zero = hn::Zero(d), steps_x = hn::Set(d, float(Blocks::width - 1)),
          steps_y = hn::Set(d, float(Blocks::height - 1));
  for (std::size_t k = 0; k < n; k += Blocks::lanes) {
    const V l1 = hn::Load(d, batch.l1 + k), l2 = hn::Load(d, batch.l2 + k), l3 = hn::Load(d, batch.l3 + k);
    const V u0 = hn::Load(d, batch.u0 + k), v0 = hn::Load(d, batch.v0 + k);
    const V q_max = hn::Add(hn::Load(d, batch.log2_opacity + k), hn::Set(d, log2_255 + 1e-3f));
    const V slant = hn::Mul(l2, steps_y);
    const V low_u = hn::Min(zero, slant), high_u = hn::MulAdd(l1, steps_x, hn::Max(zero, slant));  // l1 >= 0
    const V high_v = hn::Mul(l3, steps_y);                                                         // l3 >= 0
    for (std::size_t row = 0; row < Blocks::rows; ++row) {
      const V y = hn::Set(d, float(row * Blocks::height));
      const V v = hn::MulAdd(l3, y, v0), u_row = hn::MulAdd(l2, y, u0);
      const V nearest_v = hn::Max(zero, hn::Max(v, hn::Neg(hn::Add(v, high_v))));
      const V left = hn::NegMulAdd(nearest_v, nearest_v, q_max);
      const V u_low = hn::Add(u_row, low_u), u_high = hn::Add(u_row, high_u);
      for (std::size_t column = 0; column < Blocks::columns; ++column) {
        const V x = hn::Mul(l1, hn::Set(d, float(column * Blocks::width)));
        const V nearest_u = hn::Max(zero, hn::Max(hn::Add(u_low, x), hn::Neg(hn::Add(u_high, x))));
        batch.reach[row * Blocks::columns + column] |= Bits(d, hn::Le(hn::Mul(nearest_u, nearest_u), left)) << k;
      }
    }
  }
}

/// Blends the batch into one block. False if all of the block's rays have ended.
template <bool kColor, bool kDepth, bool kWeight>
HWY_INLINE bool Blend(D d, const Batch& batch, std::size_t block, V lane_x, V lane_y, TilePixels& pixels) {
  const V zero = hn::Zero(d), threshold = hn::Set(d, -log2_255), ceiling = hn::Set(d, float(max_alpha)),
          floor = hn::Set(d, float(min_transmittance)), half = hn::Set(d, 0.5f), sign = hn::Set(d, -0.0f);
  const std::size_t at = block * Blocks::lanes;
  V transmittance = hn::Load(d, pixels.transmittance + at);
  if (hn::AllTrue(d, hn::Lt(transmittance, zero))) return false;
  const V px = hn::Add(lane_x, hn::Set(d, float(block % Blocks::columns * Blocks::width)));
  const V py = hn::Add(lane_y, hn::Set(d, float(block / Blocks::columns * Blocks::height)));
  V red = zero, green = zero, blue = zero, depth = zero, median_depth = zero, weight = zero;
  if constexpr (kColor) {
    red = hn::Load(d, pixels.red + at), green = hn::Load(d, pixels.green + at), blue = hn::Load(d, pixels.blue + at);
  }
  if constexpr (kDepth) {
    depth = hn::Load(d, pixels.depth + at), median_depth = hn::Load(d, pixels.median_depth + at);
  }
  if constexpr (kWeight) weight = hn::Load(d, pixels.weight + at);

  for (std::uint64_t rest = batch.reach[block]; rest != 0; rest &= rest - 1) {
    const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero64(rest);
    const V u =
        hn::MulAdd(hn::Set(d, batch.l1[k]), px, hn::MulAdd(hn::Set(d, batch.l2[k]), py, hn::Set(d, batch.u0[k])));
    const V v = hn::MulAdd(hn::Set(d, batch.l3[k]), py, hn::Set(d, batch.v0[k]));
    const V power = hn::NegMulAdd(u, u, hn::NegMulAdd(v, v, hn::Set(d, batch.log2_opacity[k])));
    const V alpha = hn::IfThenElseZero(hn::Ge(power, threshold), hn::Min(Exp2(d, power), ceiling));  // from 1/255 on
    const V after = hn::NegMulAdd(transmittance, alpha, transmittance);
    const auto going_on = hn::Ge(after, floor);  // never true of a ray that has ended: its transmittance is negative
    const V w = hn::IfThenElseZero(going_on, hn::Mul(transmittance, alpha));
    if constexpr (kColor) {
      red = hn::MulAdd(w, hn::Set(d, batch.red[k]), red);
      green = hn::MulAdd(w, hn::Set(d, batch.green[k]), green);
      blue = hn::MulAdd(w, hn::Set(d, batch.blue[k]), blue);
    }
    if constexpr (kDepth) {
      const V z = hn::Set(d, batch.depth[k]);
      depth = hn::MulAdd(w, z, depth);
      const auto crosses = hn::And(going_on, hn::And(hn::Ge(transmittance, half), hn::Lt(after, half)));
      median_depth = hn::IfThenElse(crosses, z, median_depth);
    }
    if constexpr (kWeight) weight = hn::MulAdd(w, hn::Set(d, batch.weight[k]), weight);
    transmittance = hn::IfThenElse(going_on, after, hn::Or(transmittance, sign));
  }

  hn::Store(transmittance, d, pixels.transmittance + at);
  if constexpr (kColor) {
    hn::Store(red, d, pixels.red + at), hn::Store(green, d, pixels.green + at), hn::Store(blue, d, pixels.blue + at);
  }
  if constexpr (kDepth) hn::Store(depth, d, pixels.depth + at), hn::Store(median_depth, d, pixels.median_depth + at);
  if constexpr (kWeight) hn::Store(weight, d, pixels.weight + at);
  return true;
}

template <bool kColor, bool kDepth, bool kWeight>
void BlendTile(const Splat* splats, const std::uint32_t* list, std::size_t count, int x0, int y0, TilePixels& pixels) {
  const D d;
  auto fill = [](float* plane, float value) { std::fill_n(plane, TilePixels::count, value); };
  fill(pixels.transmittance, 1);
  if constexpr (kColor) fill(pixels.red, 0), fill(pixels.green, 0), fill(pixels.blue, 0);
  if constexpr (kDepth) fill(pixels.depth, 0), fill(pixels.median_depth, 0);
  if constexpr (kWeight) fill(pixels.weight, 0);
  alignas(64) float lanes_x[Blocks::lanes], lanes_y[Blocks::lanes];
  for (std::size_t i = 0; i < Blocks::lanes; ++i) {
    lanes_x[i] = float(i % Blocks::width);
    lanes_y[i] = float(i / Blocks::width);
  }
  const V lane_x = hn::Load(d, lanes_x), lane_y = hn::Load(d, lanes_y);
  Batch batch;
  for (std::size_t first = 0; first < count; first += Batch::size) {
    const std::size_t n = HWY_MIN(Batch::size, count - first);
    Fill(splats, list + first, n, x0, y0, batch);
    for (std::size_t k = first + n; k < HWY_MIN(first + n + Batch::size, count); ++k) hwy::Prefetch(&splats[list[k]]);
    FindReach(d, n, batch);
    bool live = false;
    for (std::size_t block = 0; block < Blocks::count; ++block)
      live |= Blend<kColor, kDepth, kWeight>(d, batch, block, lane_x, lane_y, pixels);
    if (!live) return;
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
      std::copy_n(from + y * Blocks::width, Blocks::width, to + y * tile_size);
  }
}

/// Turns the state of the rays into what a picture shows: alpha, and the background through what is left.
template <bool kColor>
void Finish(Vec3 background, TilePixels& pixels) {
  const D d;
  for (std::size_t i = 0; i < TilePixels::count; i += Blocks::lanes) {
    const V left = hn::Abs(hn::Load(d, pixels.transmittance + i));
    hn::Store(hn::Sub(hn::Set(d, 1.0f), left), d, pixels.alpha + i);
    if constexpr (kColor) {
      hn::Store(hn::MulAdd(left, hn::Set(d, background.x), hn::Load(d, pixels.red + i)), d, pixels.red + i);
      hn::Store(hn::MulAdd(left, hn::Set(d, background.y), hn::Load(d, pixels.green + i)), d, pixels.green + i);
      hn::Store(hn::MulAdd(left, hn::Set(d, background.z), hn::Load(d, pixels.blue + i)), d, pixels.blue + i);
    }
  }
}

template <bool kColor, bool kDepth, bool kWeight>
void Composite(const Splat* splats, const std::uint32_t* list, std::size_t count, int x0, int y0, Vec3 background,
               TilePixels& tile) {
  BlendTile<kColor, kDepth, kWeight>(splats, list, count, x0, y0, tile);
  Finish<kColor>(background, tile);
  ToRows(tile.alpha);
  if constexpr (kColor) ToRows(tile.red), ToRows(tile.green), ToRows(tile.blue);
  if constexpr (kDepth) ToRows(tile.depth), ToRows(tile.median_depth);
  if constexpr (kWeight) ToRows(tile.weight);
}

void CompositeTile(const Splat* splats, const std::uint32_t* list, std::size_t count, int x0, int y0, Channels channels,
                   Vec3 background, TilePixels& tile) {
  if (channels.depth) {
    if (channels.weight) return Composite<true, true, true>(splats, list, count, x0, y0, background, tile);
    return Composite<true, true, false>(splats, list, count, x0, y0, background, tile);
  }
  if (channels.weight) {
    if (channels.color) return Composite<true, false, true>(splats, list, count, x0, y0, background, tile);
    return Composite<false, false, true>(splats, list, count, x0, y0, background, tile);
  }
  if (channels.color) return Composite<true, false, false>(splats, list, count, x0, y0, background, tile);
  return Composite<false, false, false>(splats, list, count, x0, y0, background, tile);
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::render {

HWY_EXPORT(CompositeTile);

void composite_tile(const Splat* splats, std::span<const std::uint32_t> list, int x0, int y0, Channels channels,
                    Vec3 background, TilePixels& tile) {
  HWY_DYNAMIC_DISPATCH(CompositeTile)(splats, list.data(), list.size(), x0, y0, channels, background, tile);
}

}  // namespace engine::render
#endif
