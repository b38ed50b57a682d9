// The largest blending weight of each splat in one tile.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/simd/largest_tile_weights.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: compiled once per instruction set.
#include "engine/render/simd/tile_weights.inc"

#include <algorithm>

#include "engine/render/splats.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

/// The largest weights of a batch's splats, lane by lane.
struct LargestOfBatch {
  float* out;  ///< [splats of the list]
  alignas(64) float lanes[Batch::size * Blocks::lanes];

  HWY_INLINE void Begin(std::size_t n) { std::fill_n(lanes, n * Blocks::lanes, 0.0f); }
  HWY_INLINE auto Of(D d, std::size_t) {
    return [this, d](std::size_t k, V w) HWY_ATTR {
      float* const so_far = lanes + k * Blocks::lanes;
      hn::Store(hn::Max(w, hn::Load(d, so_far)), d, so_far);
    };
  }
  HWY_INLINE void End(std::size_t first, std::size_t n) {
    for (std::size_t k = 0; k < n; ++k)
      out[first + k] = *std::max_element(lanes + k * Blocks::lanes, lanes + (k + 1) * Blocks::lanes);
  }
};

void LargestWeights(const Splat* splats, const std::uint32_t* list, std::size_t count, TilePlace place, float* out) {
  LargestOfBatch largest;
  largest.out = out;
  std::fill_n(out, count, 0.0f);
  WalkTile(splats, list, count, place, largest);
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
