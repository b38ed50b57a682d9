// Pulls back the blending of one tile, a vector of pixels at a time, from where its rays ended.
#include <hwy/cache_control.h>
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/composite_vjp_simd.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: compiled once per instruction set.
#include "engine/render/tile_blocks.inc"

#include <algorithm>
#include <cassert>

#include "engine/render/backward_stages.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

/// dL/d(pictures) of a tile, block by block.
struct alignas(64) BlockUpstream {
  float red[TilePixels::count], green[TilePixels::count], blue[TilePixels::count];
  float depth[TilePixels::count];  ///< Read only if there is any.
};

/// The rays of a tile on their way back, block by block.
struct alignas(64) Rays {
  float transmittance[TilePixels::count];  ///< What reached the splat that was come to last.
  float beyond[TilePixels::count];  ///< dL/dT of that splat and all that lies farther back, T being what reached it.
};

/// A splat's sums over pixels, one lane each.
struct Sums {
  V g, along, across, along_along, along_across, across_across, red, green, blue, depth;
};

#if HWY_TARGET == HWY_SCALAR
HWY_INLINE void StoreGradient(D /*d*/, const Sums& sums, TileGradient& to) {
  to = {.g = hn::GetLane(sums.g),
        .along = hn::GetLane(sums.along),
        .across = hn::GetLane(sums.across),
        .along_along = hn::GetLane(sums.along_along),
        .along_across = hn::GetLane(sums.along_across),
        .across_across = hn::GetLane(sums.across_across),
        .red = hn::GetLane(sums.red),
        .green = hn::GetLane(sums.green),
        .blue = hn::GetLane(sums.blue),
        .depth = hn::GetLane(sums.depth),
        .padding = {}};
}
#else
/// Per four lanes, the sums of a, b, c and e over them.
HWY_INLINE V SumFours(D d, V a, V b, V c, V e) {
  static_assert(Blocks::lanes >= 4);
  const hn::Repartition<double, D> d64;
  const auto ab = hn::BitCast(d64, hn::Add(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b)));
  const auto ce = hn::BitCast(d64, hn::Add(hn::InterleaveLower(d, c, e), hn::InterleaveUpper(d, c, e)));
  return hn::Add(hn::BitCast(d, hn::InterleaveLower(d64, ab, ce)), hn::BitCast(d, hn::InterleaveUpper(d64, ab, ce)));
}

/// Sums over all fours of lanes.
template <class AnyD>
HWY_INLINE hn::Vec<hn::FixedTag<float, 4> > SumBlocks(AnyD d, hn::Vec<AnyD> v) {
  if constexpr (hn::MaxLanes(AnyD()) == 4) {
    return v;
  } else {
    const hn::Half<AnyD> half;
    return SumBlocks(half, hn::Add(hn::LowerHalf(half, v), hn::UpperHalf(half, v)));
  }
}

/// Sums over the lanes; all of them together, since shuffles are what this costs.
HWY_INLINE void StoreGradient(D d, const Sums& sums, TileGradient& to) {
  const hn::FixedTag<float, 4> d4;
  float* const floats = &to.g;  // the members of TileGradient, in order
  hn::StoreU(SumBlocks(d, SumFours(d, sums.g, sums.along, sums.across, sums.along_along)), d4, floats);
  hn::StoreU(SumBlocks(d, SumFours(d, sums.along_across, sums.across_across, sums.red, sums.green)), d4, floats + 4);
  const auto twos = SumBlocks(
      d, hn::Add(hn::InterleaveLower(d, sums.blue, sums.depth), hn::InterleaveUpper(d, sums.blue, sums.depth)));
  hn::StoreU(hn::Add(twos, hn::Shuffle1032(twos)), d4, floats + 8);  // and once more, over the padding
}
#endif

/// Bit k: entry k of the n has a number.
HWY_INLINE std::uint64_t Changeable(const std::uint32_t* pair_of_entry, std::size_t n) {
  const hn::RebindToUnsigned<D> du;
  const auto no_pair = hn::Set(du, ForwardBuffers::no_pair);
  std::uint64_t bits = 0;
  std::size_t k = 0;
  for (; k + Blocks::lanes <= n; k += Blocks::lanes)
    bits |= Bits(du, hn::Ne(hn::LoadU(du, pair_of_entry + k), no_pair)) << k;
  for (; k < n; ++k) bits |= std::uint64_t{pair_of_entry[k] != ForwardBuffers::no_pair} << k;
  return bits;
}

/// The n lowest bits of 64.
HWY_INLINE std::uint64_t FirstBits(std::int64_t n) {
  return n <= 0 ? 0 : n >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << n) - 1;
}

/// A set of blocks.
struct BlockSet {
  static constexpr std::size_t words = (Blocks::count + 63) / 64;
  std::uint64_t bits[words];
};

/// From the splats that reach each block to the blocks that each splat reaches.
///   out  [Batch::size]
HWY_INLINE void Transpose(const std::uint64_t* reach, BlockSet* out) {
  const hn::RebindToUnsigned<D> du;
  std::fill_n(out, Batch::size, BlockSet{});
  for (std::size_t block = 0; block < Blocks::count; block += Blocks::lanes) {
    alignas(64) std::uint32_t lower[Blocks::lanes], upper[Blocks::lanes];
    for (std::size_t i = 0; i < Blocks::lanes; ++i) {
      lower[i] = std::uint32_t(reach[block + i]);
      upper[i] = std::uint32_t(reach[block + i] >> 32);
    }
    const auto low = hn::Load(du, lower), high = hn::Load(du, upper);
    for (std::size_t k = 0; k < 32; ++k) {
      const auto bit = hn::Set(du, std::uint32_t{1} << k);
      out[k].bits[block / 64] |= Bits(du, hn::TestBit(low, bit)) << block % 64;
      out[k + 32].bits[block / 64] |= Bits(du, hn::TestBit(high, bit)) << block % 64;
    }
  }
}

/// Walks all rays back through a batch, splat by splat: a splat's sums stay in registers. The pullbacks are blend_vjp()
/// and falloff_vjp() of blend.h, one of them in another form: with X = dL/dT of what lies beyond, per unit of
/// transmittance,
///   dL/dalpha = T (v_weight - X),   X <- X + alpha (v_weight - X),
/// and T alpha is the weight.
///   first          number of the batch's first splat in the tile's list
///   asked          bits of the splats that are asked for: in front of them nothing may change
///   changeable     bits of the splats whose rows may change
///   pair_of_entry  [splats of the batch] see composite_tile_vjp()
template <bool kDepth>
HWY_INLINE void WalkBack(D d, std::size_t first, const Batch& batch, std::uint64_t asked, std::uint64_t changeable,
                         const BlockUpstream& upstream, const RayEnds& ends, Rays& rays,
                         const std::uint32_t* pair_of_entry, TileGradient* pairs) {
  const hn::RebindToSigned<D> di;
  BlockSet blocks[Batch::size];
  Transpose(batch.reach, blocks);
  std::uint64_t met = 0;
  for (const std::uint64_t reach : batch.reach) met |= reach;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), ceiling = hn::Set(d, float(max_alpha));
  for (std::uint64_t rest = (met | changeable) & asked; rest != 0;) {
    const std::size_t k = hwy::Num0BitsAboveMS1Bit_Nonzero64(rest) ^ 63;
    const std::uint64_t bit = std::uint64_t{1} << k;
    rest ^= bit;
    const V red = hn::Set(d, batch.red[k]), green = hn::Set(d, batch.green[k]), blue = hn::Set(d, batch.blue[k]),
            depth = hn::Set(d, batch.depth[k]);
    const auto number = hn::Set(di, std::int32_t(first + k));
    const auto each_block = [&](auto&& use) {
      for (std::size_t word = 0; word < BlockSet::words; ++word)
        for (std::uint64_t left = blocks[k].bits[word]; left != 0; left &= left - 1)
          use((64 * word + hwy::Num0BitsBelowLS1Bit_Nonzero64(left)) * Blocks::lanes);
    };
    /// One step of the rays at `at`: alpha, zero where not blended, and v_weight - X; T and X come to be those before
    /// the splat. T by division, which costs less than keeping each of them on the way there.
    const auto step = [&](std::size_t at, V v_red, V v_green, V v_blue, V& transmittance, V& gain, V& u, V& v) {
      const V alpha = hn::IfThenElseZero(
          hn::RebindMask(d, hn::Lt(number, hn::Load(di, ends.end + at))),
          AlphaOf(d, PowerAt(d, batch, k, hn::Load(d, places.x + at), hn::Load(d, places.y + at), u, v)));
      transmittance = hn::Mul(hn::Load(d, rays.transmittance + at), hn::Div(one, hn::Sub(one, alpha)));
      hn::Store(transmittance, d, rays.transmittance + at);
      const V beyond = hn::Load(d, rays.beyond + at);
      gain = hn::MulAdd(red, v_red, hn::MulAdd(green, v_green, hn::MulSub(blue, v_blue, beyond)));
      if constexpr (kDepth) gain = hn::MulAdd(depth, hn::Load(d, upstream.depth + at), gain);
      hn::Store(hn::MulAdd(alpha, gain, beyond), d, rays.beyond + at);
      return alpha;
    };
    if ((changeable & bit) == 0) {
      each_block([&](std::size_t at) {
        V transmittance, gain, u, v;
        step(at, hn::Load(d, upstream.red + at), hn::Load(d, upstream.green + at), hn::Load(d, upstream.blue + at),
             transmittance, gain, u, v);
      });
      continue;
    }
    Sums sums{zero, zero, zero, zero, zero, zero, zero, zero, zero, zero};
    each_block([&](std::size_t at) {
      const V v_red = hn::Load(d, upstream.red + at), v_green = hn::Load(d, upstream.green + at),
              v_blue = hn::Load(d, upstream.blue + at);
      V transmittance, gain, u, v;
      const V alpha = step(at, v_red, v_green, v_blue, transmittance, gain, u, v);
      const V weight = hn::Mul(transmittance, alpha);
      const V g = hn::IfThenElseZero(hn::Lt(alpha, ceiling), hn::Mul(weight, gain));
      const V gu = hn::Mul(g, u), gv = hn::Mul(g, v);
      sums.g = hn::Add(sums.g, g), sums.along = hn::Add(sums.along, gu), sums.across = hn::Add(sums.across, gv);
      sums.along_along = hn::MulAdd(gu, u, sums.along_along);
      sums.along_across = hn::MulAdd(gu, v, sums.along_across);
      sums.across_across = hn::MulAdd(gv, v, sums.across_across);
      sums.red = hn::MulAdd(weight, v_red, sums.red), sums.green = hn::MulAdd(weight, v_green, sums.green);
      sums.blue = hn::MulAdd(weight, v_blue, sums.blue);
      if constexpr (kDepth) sums.depth = hn::MulAdd(weight, hn::Load(d, upstream.depth + at), sums.depth);
    });
    StoreGradient(d, sums, pairs[pair_of_entry[k]]);
  }
}

/// From rows to block order.
HWY_INLINE void ToBlocks(const float* rows, float* blocks) {
  for (std::size_t b = 0; b < Blocks::count; ++b) {
    const float* from = rows + b / Blocks::columns * Blocks::height * tile_size + b % Blocks::columns * Blocks::width;
    for (std::size_t y = 0; y < Blocks::height; ++y)
      std::copy_n(from + y * tile_size, Blocks::width, blocks + b * Blocks::lanes + y * Blocks::width);
  }
}

template <bool kDepth>
void WalkTile(const Splat* splats, const std::uint32_t* list, std::size_t count, const std::uint32_t* pair_of_entry,
              int x0, int y0, const TileUpstream& rows_upstream, const RayEnds& ends, TileGradient* pairs) {
  const D d;
  const hn::RebindToSigned<D> di;
  std::int32_t block_ends[Blocks::count];  // the farthest of its rays
  for (std::size_t block = 0; block < Blocks::count; ++block)
    block_ends[block] = hn::GetLane(hn::MaxOfLanes(di, hn::Load(di, ends.end + block * Blocks::lanes)));
  const auto passed = std::size_t(*std::max_element(block_ends, block_ends + Blocks::count));
  assert(passed <= count);  // or the ends are of another picture
  // What no ray got to.
  for (std::size_t k = passed; k < count; ++k)
    if (pair_of_entry[k] != ForwardBuffers::no_pair) pairs[pair_of_entry[k]] = {};
  // In front of the nearest splat that may change nothing is asked for.
  std::size_t asked = 0;
  while (asked < passed && pair_of_entry[asked] == ForwardBuffers::no_pair) ++asked;
  if (asked == passed) return;

  BlockUpstream upstream;
  ToBlocks(rows_upstream.red, upstream.red);
  ToBlocks(rows_upstream.green, upstream.green);
  ToBlocks(rows_upstream.blue, upstream.blue);
  if constexpr (kDepth) ToBlocks(rows_upstream.depth, upstream.depth);
  Rays rays;
  ToBlocks(rows_upstream.transmittance, rays.beyond);
  std::copy_n(ends.transmittance, TilePixels::count, rays.transmittance);
  Batch batch;
  for (std::size_t b = (passed + Batch::size - 1) / Batch::size; b-- > asked / Batch::size;) {
    const std::size_t first = b * Batch::size, n = HWY_MIN(Batch::size, passed - first);
    Fill(splats, list + first, n, x0, y0, batch);
    if (b > asked / Batch::size)
      for (std::size_t k = first - Batch::size; k < first; ++k) hwy::Prefetch(&splats[list[k]]);
    FindReach(d, n, batch);
    for (std::size_t block = 0; block < Blocks::count; ++block)
      batch.reach[block] &= FirstBits(block_ends[block] - std::int64_t(first));
    const std::uint64_t bits_asked = asked > first ? ~std::uint64_t{0} << (asked - first) : ~std::uint64_t{0};
    WalkBack<kDepth>(d, first, batch, bits_asked, Changeable(pair_of_entry + first, n), upstream, ends, rays,
                     pair_of_entry + first, pairs);
  }
}

void CompositeTileVjp(const Splat* splats, const std::uint32_t* list, std::size_t count,
                      const std::uint32_t* pair_of_entry, int x0, int y0, const TileUpstream& upstream, bool with_depth,
                      const RayEnds& ends, TileGradient* pairs) {
  if (with_depth) {
    WalkTile<true>(splats, list, count, pair_of_entry, x0, y0, upstream, ends, pairs);
  } else {
    WalkTile<false>(splats, list, count, pair_of_entry, x0, y0, upstream, ends, pairs);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::render {

HWY_EXPORT(CompositeTileVjp);

void composite_tile_vjp(const Splat* splats, std::span<const std::uint32_t> list, const std::uint32_t* pair_of_entry,
                        int x0, int y0, const TileUpstream& upstream, bool with_depth, const RayEnds& ends,
                        TileGradient* pairs) {
  HWY_DYNAMIC_DISPATCH(CompositeTileVjp)
  (splats, list.data(), list.size(), pair_of_entry, x0, y0, upstream, with_depth, ends, pairs);
}

}  // namespace engine::render
#endif
