// The sums of each splat's blending weights over one tile: the walk of composite_tile.cc with another result.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/simd/sum_tile_weights.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: compiled once per instruction set.
#include "engine/render/simd/tile_blocks.inc"

#include <algorithm>

#include "engine/render/splats.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

/// Sums of a batch's splats, lane by lane.
struct LaneSums {
  alignas(64) float all[Batch::size * Blocks::lanes], valued[Batch::size * Blocks::lanes];
};

/// Walks the batch through one block. False if all of the block's rays have ended.
///   values  of the tile's pixels, block by block
HWY_INLINE bool WalkBlock(D d, const Batch& batch, std::size_t block, const float* values, float* transmittances,
                          LaneSums& sums) {
  V transmittance = hn::Load(d, transmittances + block * Blocks::lanes);
  if (AllEnded(d, transmittance)) return false;
  const V px = hn::Load(d, places.x + block * Blocks::lanes), py = hn::Load(d, places.y + block * Blocks::lanes);
  const V value = hn::Load(d, values + block * Blocks::lanes);
  for (std::uint64_t rest = batch.reach[block]; rest != 0; rest &= rest - 1) {
    const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero64(rest);
    const V alpha = AlphaAt(d, batch, k, px, py);
    const V before = transmittance;
    V after;
    const auto going_on = Pass(d, alpha, transmittance, after);
    if (hn::AllFalse(d, going_on)) break;
    const V w = hn::IfThenElseZero(going_on, hn::Mul(before, alpha));
    float* const all = sums.all + k * Blocks::lanes;
    float* const valued = sums.valued + k * Blocks::lanes;
    hn::Store(hn::Add(w, hn::Load(d, all)), d, all);
    hn::Store(hn::MulAdd(w, value, hn::Load(d, valued)), d, valued);
  }
  hn::Store(transmittance, d, transmittances + block * Blocks::lanes);
  return true;
}

void SumWeights(const Splat* splats, const std::uint32_t* list, std::size_t count, TilePlace place, const float* value,
                float* all, float* valued) {
  const D d;
  alignas(64) float transmittances[TilePixels::count], values[TilePixels::count];
  BeginRays(place, transmittances);
  EachBlockRow([&](std::size_t at, std::size_t x, std::size_t y) {
    std::copy_n(value + y * tile_size + x, Blocks::width, values + at);
  });
  Batch batch;
  LaneSums sums;
  std::fill_n(all, count, 0.0f);
  std::fill_n(valued, count, 0.0f);
  for (std::size_t first = 0; first < count; first += Batch::size) {
    const std::size_t n = HWY_MIN(Batch::size, count - first);
    Fill(splats, list + first, n, place.x0, place.y0, batch);
    FindReach(d, n, batch);
    std::fill_n(sums.all, n * Blocks::lanes, 0.0f);
    std::fill_n(sums.valued, n * Blocks::lanes, 0.0f);
    bool live = false;
    for (std::size_t block = 0; block < Blocks::count; ++block)
      live |= WalkBlock(d, batch, block, values, transmittances, sums);
    for (std::size_t k = 0; k < n; ++k)
      for (std::size_t lane = k * Blocks::lanes; lane < (k + 1) * Blocks::lanes; ++lane)
        all[first + k] += sums.all[lane], valued[first + k] += sums.valued[lane];
    if (!live) return;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::render {

HWY_EXPORT(SumWeights);

void sum_tile_weights(const Splat* splats, std::span<const std::uint32_t> list, TilePlace place, const float* value,
                      float* all, float* valued) {
  HWY_DYNAMIC_DISPATCH(SumWeights)(splats, list.data(), list.size(), place, value, all, valued);
}

}  // namespace engine::render
#endif
