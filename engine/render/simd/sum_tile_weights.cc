// The sums of each splat's blending weights over one tile.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/simd/sum_tile_weights.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: compiled once per instruction set.
#include "engine/render/simd/tile_weights.inc"

#include <algorithm>

#include "engine/render/splats.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

/// The sums of the weights of a batch's splats, lane by lane.
struct SumsOfBatch {
  float *all, *valued;                          ///< [splats of the list]
  alignas(64) float values[TilePixels::count];  ///< Of the tile's pixels, block by block.
  alignas(64) float all_lanes[Batch::size * Blocks::lanes], valued_lanes[Batch::size * Blocks::lanes];

  HWY_INLINE void Begin(std::size_t n) {
    std::fill_n(all_lanes, n * Blocks::lanes, 0.0f);
    std::fill_n(valued_lanes, n * Blocks::lanes, 0.0f);
  }
  HWY_INLINE auto Of(D d, std::size_t block) {
    return [this, d, value = hn::Load(d, values + block * Blocks::lanes)](std::size_t k, V w) HWY_ATTR {
      float* const sum = all_lanes + k * Blocks::lanes;
      float* const valued_sum = valued_lanes + k * Blocks::lanes;
      hn::Store(hn::Add(w, hn::Load(d, sum)), d, sum);
      hn::Store(hn::MulAdd(w, value, hn::Load(d, valued_sum)), d, valued_sum);
    };
  }
  HWY_INLINE void End(std::size_t first, std::size_t n) {
    for (std::size_t k = 0; k < n; ++k)
      for (std::size_t lane = k * Blocks::lanes; lane < (k + 1) * Blocks::lanes; ++lane)
        all[first + k] += all_lanes[lane], valued[first + k] += valued_lanes[lane];
  }
};

void SumWeights(const Splat* splats, const std::uint32_t* list, std::size_t count, TilePlace place, const float* value,
                float* all, float* valued) {
  SumsOfBatch sums;
  sums.all = all, sums.valued = valued;
  EachBlockRow([&](std::size_t at, std::size_t x, std::size_t y) {
    std::copy_n(value + y * tile_size + x, Blocks::width, sums.values + at);
  });
  std::fill_n(all, count, 0.0f);
  std::fill_n(valued, count, 0.0f);
  WalkTile(splats, list, count, place, sums);
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
