// Pulls back the blending of one tile, a vector of pixels at a time: there to find where each ray ends, then back.
#include <hwy/cache_control.h>
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/composite_vjp_simd.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: compiled once per instruction set.
#include "engine/render/tile_blocks.inc"

#include <algorithm>
#include <bit>

#include "engine/render/backward_stages.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

/// A batch on its way back: what Blend() found, so that neither exp2 nor the decisions of cuts are made twice.
struct TracedBatch {
  Batch batch;                       ///< reach: only of blocks that still had a ray.
  std::uint64_t changeable;          ///< Bit k: splat k's row may change.
  std::uint32_t end[Blocks::count];  ///< Where a block's steps end.
  float* steps;  ///< Per set bit of reach, block by block: a vector of alphas and one of weights, zero where not
                 ///< blended.
};
constexpr std::size_t step_size = 2 * Blocks::lanes;
static_assert(sizeof(TracedBatch) <= sizeof(TileTrace::Part));
static_assert(Batch::size * 2 * TilePixels::count <= TileTrace::slab_size);

/// The rays of a tile, block by block.
struct alignas(64) Rays {
  float transmittance[TilePixels::count];  ///< On the way there, as TilePixels has it.
  float beyond[TilePixels::count];  ///< On the way back: dL/dT of all that lies farther back, T being what reaches it.
};

/// Where the pixels of a tile are, block by block.
struct alignas(64) Places {
  float x[TilePixels::count], y[TilePixels::count];

  Places() {
    for (std::size_t i = 0; i < TilePixels::count; ++i) {
      const std::size_t block = i / Blocks::lanes, lane = i % Blocks::lanes;
      x[i] = float(block % Blocks::columns * Blocks::width + lane % Blocks::width);
      y[i] = float(block / Blocks::columns * Blocks::height + lane / Blocks::width);
    }
  }
};

/// Blend() of composite_simd.cc, of which alphas, weights and transmittance are kept. False if all rays of the block
/// had ended before.
///   next  where the block's steps start; set to where they end
HWY_INLINE bool Trace(D d, const Places& places, std::size_t block, float*& next, TracedBatch& traced,
                      float* transmittances) {
  const Batch& batch = traced.batch;
  V transmittance = hn::Load(d, transmittances + block * Blocks::lanes);
  if (AllEnded(d, transmittance)) {
    traced.batch.reach[block] = 0;
    return false;
  }
  const V px = hn::Load(d, places.x + block * Blocks::lanes), py = hn::Load(d, places.y + block * Blocks::lanes);
  float* step = next;
  for (std::uint64_t rest = batch.reach[block]; rest != 0; rest &= rest - 1) {
    const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero64(rest);
    const V alpha = AlphaAt(d, batch, k, px, py);
    const V before = transmittance;
    V after;
    const auto going_on = Pass(d, alpha, transmittance, after);
    hn::Store(hn::IfThenElseZero(going_on, alpha), d, step);
    hn::Store(hn::IfThenElseZero(going_on, hn::Mul(before, alpha)), d, step + Blocks::lanes);
    step += step_size;
  }
  next = step;
  traced.end[block] = std::uint32_t(step - traced.steps);
  hn::Store(transmittance, d, transmittances + block * Blocks::lanes);
  return true;
}

/// Sums over the lanes of four vectors.
HWY_INLINE void StoreSums(D d, V a, V b, V c, V e, float* to) {
#if HWY_TARGET == HWY_SCALAR
  for (const V sum : {a, b, c, e}) *to++ = hn::GetLane(sum);
  (void)d;
#else
  static_assert(Blocks::lanes >= 4);
  // Per four lanes: (a0 + a2, b0 + b2, a1 + a3, b1 + b3), then the sums of all four, then those of the next four.
  const hn::Repartition<double, D> d64;
  const auto ab = hn::BitCast(d64, hn::Add(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b)));
  const auto ce = hn::BitCast(d64, hn::Add(hn::InterleaveLower(d, c, e), hn::InterleaveUpper(d, c, e)));
  alignas(64) float sums[Blocks::lanes];
  hn::Store(hn::Add(hn::BitCast(d, hn::InterleaveLower(d64, ab, ce)), hn::BitCast(d, hn::InterleaveUpper(d64, ab, ce))),
            d, sums);
  const hn::FixedTag<float, 4> d4;
  auto sum = hn::Load(d4, sums);
  for (std::size_t i = 4; i < Blocks::lanes; i += 4) sum = hn::Add(sum, hn::Load(d4, sums + i));
  hn::StoreU(sum, d4, to);
#endif
}

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
/// and falloff_vjp() of blend.h in another form: with X = dL/dT of what lies beyond, per unit of transmittance,
///   dL/dalpha = T (v_weight - X),   X <- X + alpha (v_weight - X),
/// which needs no division, and T alpha is the weight.
///   first  of the splats that are asked for: in front of it nothing may change
///   pair_of_entry  [splats of the batch] see composite_tile_vjp()
template <bool kDepth>
HWY_INLINE void WalkBack(D d, const Places& places, std::size_t first, const TracedBatch& traced,
                         const TileUpstream& upstream, Rays& rays, const std::uint32_t* pair_of_entry,
                         TileGradient* pairs) {
  const Batch& batch = traced.batch;
  BlockSet blocks[Batch::size];
  Transpose(batch.reach, blocks);
  const float* ends[Blocks::count];
  std::uint64_t met = 0;
  for (std::size_t block = 0; block < Blocks::count; ++block) {
    ends[block] = traced.steps + traced.end[block];
    met |= batch.reach[block];
  }
  const V zero = hn::Zero(d), ceiling = hn::Set(d, float(max_alpha));
  for (std::uint64_t rest = (met | traced.changeable) >> first << first; rest != 0;) {
    const std::size_t k = hwy::Num0BitsAboveMS1Bit_Nonzero64(rest) ^ 63;
    const std::uint64_t bit = std::uint64_t{1} << k;
    rest ^= bit;
    const V red = hn::Set(d, batch.red[k]), green = hn::Set(d, batch.green[k]), blue = hn::Set(d, batch.blue[k]),
            depth = hn::Set(d, batch.depth[k]);
    const auto each_block = [&](auto&& use) {
      for (std::size_t word = 0; word < BlockSet::words; ++word)
        for (std::uint64_t left = blocks[k].bits[word]; left != 0; left &= left - 1)
          use(64 * word + hwy::Num0BitsBelowLS1Bit_Nonzero64(left));
    };
    /// v_weight - X.
    const auto gain = [&](std::size_t at, V v_red, V v_green, V v_blue, V beyond) {
      V sum = hn::MulAdd(red, v_red, hn::MulAdd(green, v_green, hn::MulSub(blue, v_blue, beyond)));
      if constexpr (kDepth) sum = hn::MulAdd(depth, hn::Load(d, upstream.depth + at), sum);
      return sum;
    };
    if ((traced.changeable & bit) == 0) {
      each_block([&](std::size_t block) {
        const std::size_t at = block * Blocks::lanes;
        const V alpha = hn::Load(d, ends[block] -= step_size), beyond = hn::Load(d, rays.beyond + at);
        const V v = gain(at, hn::Load(d, upstream.red + at), hn::Load(d, upstream.green + at),
                         hn::Load(d, upstream.blue + at), beyond);
        hn::Store(hn::MulAdd(alpha, v, beyond), d, rays.beyond + at);
      });
      continue;
    }
    const V l1 = hn::Set(d, batch.l1[k]), l2 = hn::Set(d, batch.l2[k]), l3 = hn::Set(d, batch.l3[k]),
            u0 = hn::Set(d, batch.u0[k]), v0 = hn::Set(d, batch.v0[k]);
    V sum_g = zero, sum_u = zero, sum_v = zero, sum_uu = zero, sum_uv = zero, sum_vv = zero;
    V sum_red = zero, sum_green = zero, sum_blue = zero, sum_depth = zero;
    each_block([&](std::size_t block) {
      const std::size_t at = block * Blocks::lanes;
      const float* const step = ends[block] -= step_size;
      const V alpha = hn::Load(d, step), weight = hn::Load(d, step + Blocks::lanes);
      const V beyond = hn::Load(d, rays.beyond + at);
      const V v_red = hn::Load(d, upstream.red + at), v_green = hn::Load(d, upstream.green + at),
              v_blue = hn::Load(d, upstream.blue + at);
      const V v_gain = gain(at, v_red, v_green, v_blue, beyond);
      hn::Store(hn::MulAdd(alpha, v_gain, beyond), d, rays.beyond + at);
      const V px = hn::Load(d, places.x + at), py = hn::Load(d, places.y + at);
      const V u = hn::MulAdd(l1, px, hn::MulAdd(l2, py, u0)), v = hn::MulAdd(l3, py, v0);
      const V g = hn::IfThenElseZero(hn::Lt(alpha, ceiling), hn::Mul(weight, v_gain));
      const V gu = hn::Mul(g, u), gv = hn::Mul(g, v);
      sum_g = hn::Add(sum_g, g), sum_u = hn::Add(sum_u, gu), sum_v = hn::Add(sum_v, gv);
      sum_uu = hn::MulAdd(gu, u, sum_uu), sum_uv = hn::MulAdd(gu, v, sum_uv), sum_vv = hn::MulAdd(gv, v, sum_vv);
      sum_red = hn::MulAdd(weight, v_red, sum_red), sum_green = hn::MulAdd(weight, v_green, sum_green);
      sum_blue = hn::MulAdd(weight, v_blue, sum_blue);
      if constexpr (kDepth) sum_depth = hn::MulAdd(weight, hn::Load(d, upstream.depth + at), sum_depth);
    });
    auto* const to = reinterpret_cast<float*>(pairs + pair_of_entry[k]);  // the members of TileGradient, in order
    StoreSums(d, sum_g, sum_u, sum_v, sum_uu, to);
    StoreSums(d, sum_uv, sum_vv, sum_red, sum_green, to + 4);
    StoreSums(d, sum_blue, sum_depth, zero, zero, to + 8);
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
              int x0, int y0, const TileUpstream& rows_upstream, TileTrace& trace, TileGradient* pairs) {
  const D d;
  const auto part = [&](std::size_t i) -> TracedBatch& { return *reinterpret_cast<TracedBatch*>(trace.part(i).bytes); };
  const std::size_t batches = (count + Batch::size - 1) / Batch::size;
  const Places places;

  trace.clear();
  Rays rays;
  std::fill_n(rays.transmittance, TilePixels::count, 1.0f);
  std::size_t traced_batches = 0, first_changeable = batches;
  for (bool live = true; live && traced_batches < batches; ++traced_batches) {
    const std::size_t first = traced_batches * Batch::size, n = HWY_MIN(Batch::size, count - first);
    TracedBatch& traced = part(traced_batches);
    Fill(splats, list + first, n, x0, y0, traced.batch);
    for (std::size_t k = first + n; k < HWY_MIN(first + n + Batch::size, count); ++k) hwy::Prefetch(&splats[list[k]]);
    FindReach(d, n, traced.batch);
    traced.changeable = Changeable(pair_of_entry + first, n);
    if (traced.changeable != 0) first_changeable = HWY_MIN(first_changeable, traced_batches);
    std::size_t vectors = 0;
    for (const std::uint64_t reach : traced.batch.reach) vectors += std::size_t(std::popcount(reach));
    float* next = traced.steps = trace.floats(vectors * step_size);
    live = false;
    for (std::size_t block = 0; block < Blocks::count; ++block)
      live |= Trace(d, places, block, next, traced, rays.transmittance);
  }
  // What no ray got to.
  for (std::size_t k = traced_batches * Batch::size; k < count; ++k)
    if (pair_of_entry[k] != ForwardBuffers::no_pair) pairs[pair_of_entry[k]] = {};

  TileUpstream upstream;
  ToBlocks(rows_upstream.red, upstream.red);
  ToBlocks(rows_upstream.green, upstream.green);
  ToBlocks(rows_upstream.blue, upstream.blue);
  ToBlocks(rows_upstream.depth, upstream.depth);
  ToBlocks(rows_upstream.transmittance, upstream.transmittance);
  std::copy_n(upstream.transmittance, TilePixels::count, rays.beyond);
  // In front of the nearest splat that may change nothing is asked for.
  for (std::size_t b = traced_batches; b-- > first_changeable;) {
    const TracedBatch& traced = part(b);
    const std::size_t first_asked =
        b == first_changeable ? hwy::Num0BitsBelowLS1Bit_Nonzero64(traced.changeable) : std::size_t{0};
    WalkBack<kDepth>(d, places, first_asked, traced, upstream, rays, pair_of_entry + b * Batch::size, pairs);
  }
}

void CompositeTileVjp(const Splat* splats, const std::uint32_t* list, std::size_t count,
                      const std::uint32_t* pair_of_entry, int x0, int y0, const TileUpstream& upstream, bool with_depth,
                      TileTrace& trace, TileGradient* pairs) {
  if (with_depth) {
    WalkTile<true>(splats, list, count, pair_of_entry, x0, y0, upstream, trace, pairs);
  } else {
    WalkTile<false>(splats, list, count, pair_of_entry, x0, y0, upstream, trace, pairs);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::render {

HWY_EXPORT(CompositeTileVjp);

void composite_tile_vjp(const Splat* splats, std::span<const std::uint32_t> list, const std::uint32_t* pair_of_entry,
                        int x0, int y0, const TileUpstream& upstream, bool with_depth, TileTrace& trace,
                        TileGradient* pairs) {
  HWY_DYNAMIC_DISPATCH(CompositeTileVjp)
  (splats, list.data(), list.size(), pair_of_entry, x0, y0, upstream, with_depth, trace, pairs);
}

}  // namespace engine::render
#endif
