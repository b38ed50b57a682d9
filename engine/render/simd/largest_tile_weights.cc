// The largest blending weight of each splat in one tile: the walk of composite_tile.cc with another result.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/simd/largest_tile_weights.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: compiled once per instruction set.
#include "engine/render/simd/tile_blocks.inc"

#include <algorithm>

#include "engine/render/splats.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

/// Walks the batch through one block. False if all of the block's rays have ended.
///   largest  [batch][lanes] raised
HWY_INLINE bool WalkBlock(D d, const Batch& batch, std::size_t block, float* transmittances, float* largest) {
  V transmittance = hn::Load(d, transmittances + block * Blocks::lanes);
  if (AllEnded(d, transmittance)) return false;
  const V px = hn::Load(d, places.x + block * Blocks::lanes), py = hn::Load(d, places.y + block * Blocks::lanes);
  for (std::uint64_t rest = batch.reach[block]; rest != 0; rest &= rest - 1) {
    const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero64(rest);
    const V alpha = AlphaAt(d, batch, k, px, py);
    const V before = transmittance;
    V after;
    const auto going_on = Pass(d, alpha, transmittance, after);
    if (hn::AllFalse(d, going_on)) break;
    const V w = hn::IfThenElseZero(going_on, hn::Mul(before, alpha));
    float* const so_far = largest + k * Blocks::lanes;
    hn::Store(hn::Max(w, hn::Load(d, so_far)), d, so_far);
  }
  hn::Store(transmittance, d, transmittances + block * Blocks::lanes);
  return true;
}

void LargestWeights(const Splat* splats, const std::uint32_t* list, std::size_t count, TilePlace place, float* out) {
  const D d;
  alignas(64) float transmittances[TilePixels::count];
  BeginRays(place, transmittances);
  Batch batch;
  alignas(64) float largest[Batch::size * Blocks::lanes];
  std::fill_n(out, count, 0.0f);
  for (std::size_t first = 0; first < count; first += Batch::size) {
    const std::size_t n = HWY_MIN(Batch::size, count - first);
    Fill(splats, list + first, n, place.x0, place.y0, batch);
    FindReach(d, n, batch);
    std::fill_n(largest, n * Blocks::lanes, 0.0f);
    bool live = false;
    for (std::size_t block = 0; block < Blocks::count; ++block)
      live |= WalkBlock(d, batch, block, transmittances, largest);
    for (std::size_t k = 0; k < n; ++k)
      out[first + k] = *std::max_element(largest + k * Blocks::lanes, largest + (k + 1) * Blocks::lanes);
    if (!live) return;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::render {

HWY_EXPORT(LargestWeights);

void largest_tile_weights(const Splat* splats, std::span<const std::uint32_t> list, TilePlace place, float* out) {
  HWY_DYNAMIC_DISPATCH(LargestWeights)(splats, list.data(), list.size(), place, out);
}

}  // namespace engine::render
#endif
