// Blends the splats of one tile, a vector of pixels at a time.
#include <hwy/cache_control.h>
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/simd/composite_tile.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: compiled once per instruction set.
#include "engine/render/simd/tile_blocks.inc"

#include <algorithm>
#include <cassert>

#include "engine/render/splats.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

/// Which sums Blend() keeps. kEnds: where rays end.
template <bool kColor_, bool kDepth_, bool kWeight_, bool kEnds_>
struct Kept {
  static constexpr bool kColor = kColor_, kDepth = kDepth_, kWeight = kWeight_, kEnds = kEnds_;
};

/// Blends the batch into one block, nearest first:
///   w = T alpha,   C <- C + w c,   T <- T (1 - alpha)   [Kerbl 2023, eq. 3],
/// with c a colour, a depth or a weight. False if all of the block's rays have ended.
///   first  number of the batch's first splat in the tile's list
template <class K>
HWY_INLINE bool Blend(D d, const Batch& batch, std::size_t first, std::size_t block, TilePixels& pixels,
                      RayEnds* ends) {
  const hn::RebindToSigned<D> di;
  const V zero = hn::Zero(d), half = hn::Set(d, 0.5f);
  const std::size_t at = block * Blocks::lanes;
  V transmittance = hn::Load(d, pixels.transmittance + at);
  if (AllEnded(d, transmittance)) return false;
  V left = hn::Load(d, pixels.left + at);
  const V px = hn::Load(d, places.x + at), py = hn::Load(d, places.y + at);
  V red = zero, green = zero, blue = zero, depth = zero, median_depth = zero, weight = zero;
  if constexpr (K::kColor) {
    red = hn::Load(d, pixels.red + at), green = hn::Load(d, pixels.green + at), blue = hn::Load(d, pixels.blue + at);
  }
  if constexpr (K::kDepth) {
    depth = hn::Load(d, pixels.depth + at), median_depth = hn::Load(d, pixels.median_depth + at);
  }
  if constexpr (K::kWeight) weight = hn::Load(d, pixels.weight + at);
  auto end = hn::Zero(di);
  if constexpr (K::kEnds) end = hn::Load(di, ends->end + at);

  for (std::uint64_t rest = batch.reach[block]; rest != 0; rest &= rest - 1) {
    const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero64(rest);
    const V alpha = AlphaAt(d, batch, k, px, py);
    const V before = transmittance;
    V after;
    const auto going_on = Pass(d, alpha, transmittance, after);
    if (hn::AllFalse(d, going_on)) break;
    const V w = hn::IfThenElseZero(going_on, hn::Mul(before, alpha));
    left = hn::IfThenElse(going_on, after, left);
    if constexpr (K::kEnds)
      end = hn::IfThenElse(hn::RebindMask(di, going_on), hn::Set(di, std::int32_t(first + k + 1)), end);
    if constexpr (K::kColor) {
      red = hn::MulAdd(w, hn::Set(d, batch.shade[k].red), red);
      green = hn::MulAdd(w, hn::Set(d, batch.shade[k].green), green);
      blue = hn::MulAdd(w, hn::Set(d, batch.shade[k].blue), blue);
    }
    if constexpr (K::kDepth) {
      const V z = hn::Set(d, batch.shade[k].depth);
      depth = hn::MulAdd(w, z, depth);
      const auto crosses = hn::And(going_on, hn::And(hn::Ge(before, half), hn::Lt(after, half)));
      median_depth = hn::IfThenElse(crosses, z, median_depth);
    }
    if constexpr (K::kWeight) weight = hn::MulAdd(w, hn::Set(d, batch.weight[k]), weight);
  }

  hn::Store(transmittance, d, pixels.transmittance + at), hn::Store(left, d, pixels.left + at);
  if constexpr (K::kColor) {
    hn::Store(red, d, pixels.red + at), hn::Store(green, d, pixels.green + at), hn::Store(blue, d, pixels.blue + at);
  }
  if constexpr (K::kDepth) hn::Store(depth, d, pixels.depth + at), hn::Store(median_depth, d, pixels.median_depth + at);
  if constexpr (K::kWeight) hn::Store(weight, d, pixels.weight + at);
  if constexpr (K::kEnds) hn::Store(end, di, ends->end + at);
  return true;
}

template <class K>
void BlendTile(const Splat* splats, const std::uint32_t* list, std::size_t count, TilePlace place, TilePixels& pixels,
               RayEnds* ends) {
  const D d;
  auto fill = [](float* plane, float value) { std::fill_n(plane, TilePixels::count, value); };
  BeginRays(place, pixels.transmittance);
  fill(pixels.left, 1);
  if constexpr (K::kColor) fill(pixels.red, 0), fill(pixels.green, 0), fill(pixels.blue, 0);
  if constexpr (K::kDepth) fill(pixels.depth, 0), fill(pixels.median_depth, 0);
  if constexpr (K::kWeight) fill(pixels.weight, 0);
  if constexpr (K::kEnds) std::fill_n(ends->end, RayEnds::count, 0);
  Batch batch;
  for (std::size_t first = 0; first < count; first += Batch::size) {
    const std::size_t n = HWY_MIN(Batch::size, count - first);
    Fill(splats, list + first, n, place.x0, place.y0, batch);
    for (std::size_t k = first + n; k < HWY_MIN(first + n + Batch::size, count); ++k) hwy::Prefetch(&splats[list[k]]);
    FindReach(d, n, batch);
    bool live = false;
    for (std::size_t block = 0; block < Blocks::count; ++block) live |= Blend<K>(d, batch, first, block, pixels, ends);
    if (!live) break;
  }
  if constexpr (K::kEnds) std::copy_n(pixels.left, RayEnds::count, ends->transmittance);
}

/// Turns the state of the rays into what a picture shows: alpha, and the background through what is left.
template <bool kColor>
void Finish(Vec3 background, TilePixels& pixels) {
  const D d;
  for (std::size_t i = 0; i < TilePixels::count; i += Blocks::lanes) {
    const V left = hn::Load(d, pixels.left + i);
    hn::Store(hn::Sub(hn::Set(d, 1.0f), left), d, pixels.alpha + i);
    if constexpr (kColor) {
      hn::Store(hn::MulAdd(left, hn::Set(d, background.x), hn::Load(d, pixels.red + i)), d, pixels.red + i);
      hn::Store(hn::MulAdd(left, hn::Set(d, background.y), hn::Load(d, pixels.green + i)), d, pixels.green + i);
      hn::Store(hn::MulAdd(left, hn::Set(d, background.z), hn::Load(d, pixels.blue + i)), d, pixels.blue + i);
    }
  }
}

template <class K>
void Composite(const Splat* splats, const std::uint32_t* list, std::size_t count, TilePlace place, Vec3 background,
               TilePixels& tile, RayEnds* ends) {
  BlendTile<K>(splats, list, count, place, tile, ends);
  Finish<K::kColor>(background, tile);
}

void CompositeTile(const Splat* splats, const std::uint32_t* list, std::size_t count, TilePlace place,
                   Channels channels, Vec3 background, TilePixels& tile, RayEnds* ends) {
  const auto composite = [&](auto kept) {
    Composite<decltype(kept)>(splats, list, count, place, background, tile, ends);
  };
  if (ends != nullptr) {
    assert(!channels.depth && !channels.weight);
    if (channels.color) return composite(Kept<true, false, false, true>());
    return composite(Kept<false, false, false, true>());
  }
  if (channels.depth) {
    if (channels.weight) return composite(Kept<true, true, true, false>());
    return composite(Kept<true, true, false, false>());
  }
  if (channels.weight) {
    if (channels.color) return composite(Kept<true, false, true, false>());
    return composite(Kept<false, false, true, false>());
  }
  if (channels.color) return composite(Kept<true, false, false, false>());
  return composite(Kept<false, false, false, false>());
}

/// From block order to rows.
HWY_INLINE void ToRows(const float* plane, float* to, std::ptrdiff_t stride) {
  EachBlockRow([&](std::size_t at, std::size_t x, std::size_t y) {
    std::copy_n(plane + at, Blocks::width, to + std::ptrdiff_t(y) * stride + x);
  });
}

void CopyTilePlane(const float* plane, scene::Rect part, float* to, std::ptrdiff_t stride) {
  if (part == whole_tile) return ToRows(plane, to, stride);
  float rows[TilePixels::count];
  ToRows(plane, rows, tile_size);
  for (int y = part.y0; y < part.y1; ++y)
    std::copy_n(rows + y * tile_size + part.x0, part.width(), to + std::ptrdiff_t(y - part.y0) * stride);
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::render {

HWY_EXPORT(CompositeTile);
HWY_EXPORT(CopyTilePlane);

void composite_tile(const Splat* splats, std::span<const std::uint32_t> list, TilePlace place, Channels channels,
                    Vec3 background, TilePixels& tile, RayEnds* ends) {
  HWY_DYNAMIC_DISPATCH(CompositeTile)
  (splats, list.data(), list.size(), place, channels, background, tile, ends);
}

void copy_tile_plane(const float* plane, scene::Rect part, float* to, std::ptrdiff_t stride) {
  HWY_DYNAMIC_DISPATCH(CopyTilePlane)(plane, part, to, stride);
}

}  // namespace engine::render
#endif
