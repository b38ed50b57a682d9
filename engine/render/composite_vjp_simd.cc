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
  std::uint32_t end[Blocks::count];  ///< Where a block's alphas end.
  float* alpha;                      ///< One vector per set bit of reach, block by block: zero where not blended.
};
static_assert(sizeof(TracedBatch) <= sizeof(TileTrace::Part));
static_assert(Batch::size * TilePixels::count <= TileTrace::slab_size);

/// The rays of a tile, block by block.
struct alignas(64) Rays {
  float transmittance[TilePixels::count];  ///< On the way there as TilePixels has it; on the way back as RayBackward.
  float behind[TilePixels::count];
};

/// Where the pixels of a tile's blocks are.
struct Lanes {
  V x, y;
};

HWY_INLINE V PixelX(D d, const Lanes& lanes, std::size_t block) {
  return hn::Add(lanes.x, hn::Set(d, float(block % Blocks::columns * Blocks::width)));
}
HWY_INLINE V PixelY(D d, const Lanes& lanes, std::size_t block) {
  return hn::Add(lanes.y, hn::Set(d, float(block / Blocks::columns * Blocks::height)));
}

/// Blend() of composite_simd.cc, of which only alphas and transmittance are kept. False if all rays of the block had
/// ended before.
///   next  where the block's alphas start; set to where they end
HWY_INLINE bool Trace(D d, const Lanes& lanes, std::size_t block, float*& next, TracedBatch& traced,
                      float* transmittances) {
  const Batch& batch = traced.batch;
  const V threshold = hn::Set(d, -log2_255), ceiling = hn::Set(d, float(max_alpha)),
          floor = hn::Set(d, float(min_transmittance)), sign = hn::Set(d, -0.0f);
  V transmittance = hn::Load(d, transmittances + block * Blocks::lanes);
  if (hn::AllTrue(d, hn::Lt(transmittance, hn::Zero(d)))) {
    traced.batch.reach[block] = 0;
    return false;
  }
  const V px = PixelX(d, lanes, block), py = PixelY(d, lanes, block);
  float* alphas = next;
  for (std::uint64_t rest = batch.reach[block]; rest != 0; rest &= rest - 1) {
    const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero64(rest);
    const V u =
        hn::MulAdd(hn::Set(d, batch.l1[k]), px, hn::MulAdd(hn::Set(d, batch.l2[k]), py, hn::Set(d, batch.u0[k])));
    const V v = hn::MulAdd(hn::Set(d, batch.l3[k]), py, hn::Set(d, batch.v0[k]));
    const V power = hn::NegMulAdd(u, u, hn::NegMulAdd(v, v, hn::Set(d, batch.log2_opacity[k])));
    const V alpha = hn::IfThenElseZero(hn::Ge(power, threshold), hn::Min(Exp2(d, power), ceiling));
    const V after = hn::NegMulAdd(transmittance, alpha, transmittance);
    const auto going_on = hn::Ge(after, floor);
    hn::Store(hn::IfThenElseZero(going_on, alpha), d, alphas);
    alphas += Blocks::lanes;
    transmittance = hn::IfThenElse(going_on, after, hn::Or(transmittance, sign));
  }
  next = alphas;
  traced.end[block] = std::uint32_t(alphas - traced.alpha);
  hn::Store(transmittance, d, transmittances + block * Blocks::lanes);
  return true;
}

/// Sums of a batch, lane by lane: [splat][member of TileGradient][lane].
struct BatchSums {
  alignas(64) float lanes[Batch::size][TileGradient::sums][Blocks::lanes];
};

/// Walks one block's rays back through a batch. The pullbacks are blend_vjp() and falloff_vjp() of blend.h.
template <bool kDepth>
HWY_INLINE void WalkBack(D d, const Lanes& lanes, std::size_t block, const TracedBatch& traced,
                         const TileUpstream& upstream, Rays& rays, BatchSums& sums) {
  const Batch& batch = traced.batch;
  if (batch.reach[block] == 0) return;
  const std::size_t at = block * Blocks::lanes;
  const V one = hn::Set(d, 1.0f), ceiling = hn::Set(d, float(max_alpha));
  const V px = PixelX(d, lanes, block), py = PixelY(d, lanes, block);
  const V v_red = hn::Load(d, upstream.red + at), v_green = hn::Load(d, upstream.green + at),
          v_blue = hn::Load(d, upstream.blue + at), v_depth = hn::Load(d, upstream.depth + at);
  V transmittance = hn::Load(d, rays.transmittance + at), behind = hn::Load(d, rays.behind + at);
  const float* alphas = traced.alpha + traced.end[block];
  for (std::uint64_t rest = batch.reach[block]; rest != 0;) {
    const std::size_t k = hwy::Num0BitsAboveMS1Bit_Nonzero64(rest) ^ 63;
    const std::uint64_t bit = std::uint64_t{1} << k;
    rest ^= bit;
    alphas -= Blocks::lanes;
    const V alpha = hn::Load(d, alphas);
    V v_weight =
        hn::MulAdd(hn::Set(d, batch.red[k]), v_red,
                   hn::MulAdd(hn::Set(d, batch.green[k]), v_green, hn::Mul(hn::Set(d, batch.blue[k]), v_blue)));
    if constexpr (kDepth) v_weight = hn::MulAdd(hn::Set(d, batch.depth[k]), v_depth, v_weight);
    const V inverse_keep = hn::Div(one, hn::Sub(one, alpha));
    transmittance = hn::Mul(transmittance, inverse_keep);
    const V weight = hn::Mul(transmittance, alpha);
    const V v_alpha = hn::NegMulAdd(behind, inverse_keep, hn::Mul(transmittance, v_weight));
    behind = hn::MulAdd(weight, v_weight, behind);
    if ((traced.changeable & bit) == 0) continue;

    const V u =
        hn::MulAdd(hn::Set(d, batch.l1[k]), px, hn::MulAdd(hn::Set(d, batch.l2[k]), py, hn::Set(d, batch.u0[k])));
    const V v = hn::MulAdd(hn::Set(d, batch.l3[k]), py, hn::Set(d, batch.v0[k]));
    const V g = hn::IfThenElseZero(hn::Lt(alpha, ceiling), hn::Mul(alpha, v_alpha));
    const V gu = hn::Mul(g, u), gv = hn::Mul(g, v);
    float* to = sums.lanes[k][0];
    const auto add = [&](std::size_t sum, V value) {
      hn::Store(hn::Add(hn::Load(d, to + sum * Blocks::lanes), value), d, to + sum * Blocks::lanes);
    };
    const auto add_product = [&](std::size_t sum, V a, V b) {
      hn::Store(hn::MulAdd(a, b, hn::Load(d, to + sum * Blocks::lanes)), d, to + sum * Blocks::lanes);
    };
    add(0, g), add(1, gu), add(2, gv);
    add_product(3, gu, u), add_product(4, gu, v), add_product(5, gv, v);
    add_product(6, weight, v_red), add_product(7, weight, v_green), add_product(8, weight, v_blue);
    if constexpr (kDepth) add_product(9, weight, v_depth);
  }
  hn::Store(transmittance, d, rays.transmittance + at);
  hn::Store(behind, d, rays.behind + at);
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
void WalkTile(const Splat* splats, const std::uint32_t* list, std::size_t count, const std::int32_t* row_slot, int x0,
              int y0, const TileUpstream& rows_upstream, TileTrace& trace, TileGradient* out) {
  const D d;
  const auto part = [&](std::size_t i) -> TracedBatch& { return *reinterpret_cast<TracedBatch*>(trace.part(i).bytes); };
  const std::size_t batches = (count + Batch::size - 1) / Batch::size;
  alignas(64) float lanes_x[Blocks::lanes], lanes_y[Blocks::lanes];
  for (std::size_t i = 0; i < Blocks::lanes; ++i) {
    lanes_x[i] = float(i % Blocks::width);
    lanes_y[i] = float(i / Blocks::width);
  }
  const Lanes lanes{hn::Load(d, lanes_x), hn::Load(d, lanes_y)};

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
    traced.changeable = 0;
    for (std::size_t k = 0; k < n; ++k) traced.changeable |= std::uint64_t{row_slot[list[first + k]] >= 0} << k;
    if (traced.changeable != 0) first_changeable = HWY_MIN(first_changeable, traced_batches);
    std::size_t vectors = 0;
    for (const std::uint64_t reach : traced.batch.reach) vectors += std::size_t(std::popcount(reach));
    float* next = traced.alpha = trace.alphas(vectors * Blocks::lanes);
    live = false;
    for (std::size_t block = 0; block < Blocks::count; ++block)
      live |= Trace(d, lanes, block, next, traced, rays.transmittance);
  }
  // What no ray got to.
  for (std::size_t k = traced_batches * Batch::size; k < count; ++k)
    if (row_slot[list[k]] >= 0) out[k] = {};

  TileUpstream upstream;
  ToBlocks(rows_upstream.red, upstream.red);
  ToBlocks(rows_upstream.green, upstream.green);
  ToBlocks(rows_upstream.blue, upstream.blue);
  ToBlocks(rows_upstream.depth, upstream.depth);
  ToBlocks(rows_upstream.transmittance, upstream.transmittance);
  for (std::size_t i = 0; i < TilePixels::count; i += Blocks::lanes) {
    const V left = hn::Abs(hn::Load(d, rays.transmittance + i));
    hn::Store(left, d, rays.transmittance + i);
    hn::Store(hn::Mul(left, hn::Load(d, upstream.transmittance + i)), d, rays.behind + i);
  }
  BatchSums sums;
  // In front of the nearest splat that may change nothing is asked for.
  for (std::size_t b = traced_batches; b-- > first_changeable;) {
    const TracedBatch& traced = part(b);
    for (std::uint64_t rest = traced.changeable; rest != 0; rest &= rest - 1)
      std::fill_n(sums.lanes[hwy::Num0BitsBelowLS1Bit_Nonzero64(rest)][0], TileGradient::sums * Blocks::lanes, 0.0f);
    for (std::size_t block = 0; block < Blocks::count; ++block)
      WalkBack<kDepth>(d, lanes, block, traced, upstream, rays, sums);
    for (std::uint64_t rest = traced.changeable; rest != 0; rest &= rest - 1) {
      const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero64(rest);
      const auto sum = [&](std::size_t i) { return hn::GetLane(hn::SumOfLanes(d, hn::Load(d, sums.lanes[k][i]))); };
      out[b * Batch::size + k] = {.g = sum(0),
                                  .along = sum(1),
                                  .across = sum(2),
                                  .along_along = sum(3),
                                  .along_across = sum(4),
                                  .across_across = sum(5),
                                  .red = sum(6),
                                  .green = sum(7),
                                  .blue = sum(8),
                                  .depth = kDepth ? sum(9) : 0.0f};
    }
  }
}

void CompositeTileVjp(const Splat* splats, const std::uint32_t* list, std::size_t count, const std::int32_t* row_slot,
                      int x0, int y0, const TileUpstream& upstream, bool with_depth, TileTrace& trace,
                      TileGradient* out) {
  if (with_depth) {
    WalkTile<true>(splats, list, count, row_slot, x0, y0, upstream, trace, out);
  } else {
    WalkTile<false>(splats, list, count, row_slot, x0, y0, upstream, trace, out);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::render {

HWY_EXPORT(CompositeTileVjp);

void composite_tile_vjp(const Splat* splats, std::span<const std::uint32_t> list, const std::int32_t* row_slot, int x0,
                        int y0, const TileUpstream& upstream, bool with_depth, TileTrace& trace, TileGradient* out) {
  HWY_DYNAMIC_DISPATCH(CompositeTileVjp)
  (splats, list.data(), list.size(), row_slot, x0, y0, upstream, with_depth, trace, out);
}

}  // namespace engine::render
#endif
