// Pulls back the blending of one tile, a vector of pixels at a time, from where its rays ended.
#include <hwy/cache_control.h>
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/composite_vjp_simd.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: compiled once per instruction set.
#include "engine/render/lane_sums.inc"
#include "engine/render/tile_blocks.inc"

#include <algorithm>
#include <cassert>
#include <type_traits>

#include "engine/render/backward_stages.h"

HWY_BEFORE_NAMESPACE();
namespace engine::render {
namespace HWY_NAMESPACE {

/// A block of a tile while its rays go back. What a step needs lies side by side.
struct alignas(64) WalkedBlock {
  float x[Blocks::lanes], y[Blocks::lanes];                             ///< Of its pixels, from the tile's first.
  std::int32_t end[Blocks::lanes];                                      ///< See RayEnds.
  float red[Blocks::lanes], green[Blocks::lanes], blue[Blocks::lanes];  ///< dL/d(pictures)
  float depth[Blocks::lanes];                                           ///< The same. Read only if there is any.
  float transmittance[Blocks::lanes];  ///< What reached the splat that was come to last.
  float beyond[Blocks::lanes];         ///< dL/dT of that splat and all that lies farther back, T being what reached it.
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

/// The blocks that each splat of a batch reaches, less those whose rays have all ended before it.
struct ReachedBlocks {
  static constexpr std::size_t words = (Blocks::count + 31) / 32;
  alignas(64) std::uint32_t bits[words][Batch::size];
  std::uint64_t met;  ///< Bit k: splat k has any.
};

/// Finds them for a batch of n splats.
///   ends  [Blocks::count] the farthest of each block's rays, counted from the batch's first splat
HWY_INLINE void FindReachedBlocks(D d, std::size_t n, const Batch& batch, const std::int32_t* ends,
                                  ReachedBlocks& out) {
  const hn::RebindToUnsigned<D> du;
  const hn::RebindToSigned<D> di;
  out.met = 0;
  for (std::size_t k = 0; k < n; k += Blocks::lanes) {
    const auto number = hn::Iota(di, std::int32_t(k));
    hn::Vec<decltype(du)> words[ReachedBlocks::words];
    for (auto& word : words) word = hn::Zero(du);
    EachReach(d, batch, k, [&](std::size_t block, hn::Mask<D> reaches) {
      const auto before_end = hn::RebindMask(du, hn::Lt(number, hn::Set(di, ends[block])));
      auto& word = words[block / 32];
      word = hn::IfThenElse(hn::And(hn::RebindMask(du, reaches), before_end),
                            hn::Or(word, hn::Set(du, std::uint32_t{1} << block % 32)), word);
    });
    auto any = hn::Zero(du);
    for (std::size_t w = 0; w < ReachedBlocks::words; ++w) {
      hn::Store(words[w], du, out.bits[w] + k);
      any = hn::Or(any, words[w]);
    }
    out.met |= Bits(du, hn::Ne(any, hn::Zero(du))) << k;
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
///   walked         [Blocks::count]
///   pair_of_entry  [splats of the batch] see composite_tile_vjp()
template <bool kDepth>
HWY_INLINE void WalkBack(D d, std::size_t first, const Batch& batch, const ReachedBlocks& reached, std::uint64_t asked,
                         std::uint64_t changeable, WalkedBlock* walked, const std::uint32_t* pair_of_entry,
                         TileGradient* pairs) {
  const hn::RebindToSigned<D> di;
  for (std::uint64_t rest = changeable & asked & ~reached.met; rest != 0; rest &= rest - 1)
    pairs[pair_of_entry[hwy::Num0BitsBelowLS1Bit_Nonzero64(rest)]] = {};
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), ceiling = hn::Set(d, float(max_alpha));
  for (std::uint64_t rest = reached.met & asked; rest != 0;) {
    const std::size_t k = hwy::Num0BitsAboveMS1Bit_Nonzero64(rest) ^ 63;
    const std::uint64_t bit = std::uint64_t{1} << k;
    rest ^= bit;
    const V red = hn::Set(d, batch.red[k]), green = hn::Set(d, batch.green[k]), blue = hn::Set(d, batch.blue[k]),
            depth = hn::Set(d, batch.depth[k]);
    const auto number = hn::Set(di, std::int32_t(first + k));
    const auto each_block = [&](auto&& use) {
      for (std::size_t word = 0; word < ReachedBlocks::words; ++word)
        for (std::uint32_t left = reached.bits[word][k]; left != 0; left &= left - 1)
          use(walked[32 * word + hwy::Num0BitsBelowLS1Bit_Nonzero32(left)]);
    };
    /// One step of the block's rays: alpha, zero where not blended, and v_weight - X; T and X come to be those before
    /// the splat. T by division, which costs less than keeping each of them on the way there.
    const auto step = [&](auto clamped, WalkedBlock& block, V v_red, V v_green, V v_blue, V& transmittance, V& gain,
                          V& u, V& v) {
      const V power = PowerAt(d, batch, k, hn::Load(d, block.x), hn::Load(d, block.y), u, v);
      const auto before_end = hn::RebindMask(d, hn::Lt(number, hn::Load(di, block.end)));
      const V alpha = AlphaOf<clamped>(d, power, PassesCut(d, power, before_end));
      transmittance = hn::Div(hn::Load(d, block.transmittance), hn::Sub(one, alpha));
      hn::Store(transmittance, d, block.transmittance);
      const V beyond = hn::Load(d, block.beyond);
      gain = hn::MulAdd(red, v_red, hn::MulAdd(green, v_green, hn::MulSub(blue, v_blue, beyond)));
      if constexpr (kDepth) gain = hn::MulAdd(depth, hn::Load(d, block.depth), gain);
      hn::Store(hn::MulAdd(alpha, gain, beyond), d, block.beyond);
      return alpha;
    };
    if ((changeable & bit) == 0) {
      each_block([&](WalkedBlock& block) {
        V transmittance, gain, u, v;
        step(std::true_type(), block, hn::Load(d, block.red), hn::Load(d, block.green), hn::Load(d, block.blue),
             transmittance, gain, u, v);
      });
      continue;
    }
    Sums sums{zero, zero, zero, zero, zero, zero, zero, zero, zero, zero};
    const auto pull_back = [&](auto clamped) {
      each_block([&](WalkedBlock& block) {
        const V v_red = hn::Load(d, block.red), v_green = hn::Load(d, block.green), v_blue = hn::Load(d, block.blue);
        V transmittance, gain, u, v;
        const V alpha = step(clamped, block, v_red, v_green, v_blue, transmittance, gain, u, v);
        const V weight = hn::Mul(transmittance, alpha);
        V g = hn::Mul(weight, gain);
        if constexpr (clamped) g = hn::IfThenElseZero(hn::Lt(alpha, ceiling), g);
        const V gu = hn::Mul(g, u), gv = hn::Mul(g, v);
        sums.g = hn::Add(sums.g, g), sums.along = hn::Add(sums.along, gu), sums.across = hn::Add(sums.across, gv);
        sums.along_along = hn::MulAdd(gu, u, sums.along_along);
        sums.along_across = hn::MulAdd(gu, v, sums.along_across);
        sums.across_across = hn::MulAdd(gv, v, sums.across_across);
        sums.red = hn::MulAdd(weight, v_red, sums.red), sums.green = hn::MulAdd(weight, v_green, sums.green);
        sums.blue = hn::MulAdd(weight, v_blue, sums.blue);
        if constexpr (kDepth) sums.depth = hn::MulAdd(weight, hn::Load(d, block.depth), sums.depth);
      });
    };
    if (batch.log2_opacity[k] > unclamped_log2_opacity) {
      pull_back(std::true_type());
    } else {
      pull_back(std::false_type());
    }
    StoreGradient(d, sums, pairs[pair_of_entry[k]]);
  }
}

/// A tile's plane, row by row, to its blocks.
HWY_INLINE void ToBlocks(const float* rows, float (WalkedBlock::*plane)[Blocks::lanes], WalkedBlock* walked) {
  for (std::size_t b = 0; b < Blocks::count; ++b) {
    const float* from = rows + b / Blocks::columns * Blocks::height * tile_size + b % Blocks::columns * Blocks::width;
    for (std::size_t y = 0; y < Blocks::height; ++y)
      std::copy_n(from + y * tile_size, Blocks::width, walked[b].*plane + y * Blocks::width);
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

  WalkedBlock walked[Blocks::count];
  for (std::size_t b = 0, at = 0; b < Blocks::count; ++b, at += Blocks::lanes) {
    std::copy_n(places.x + at, Blocks::lanes, walked[b].x);
    std::copy_n(places.y + at, Blocks::lanes, walked[b].y);
    std::copy_n(ends.end + at, Blocks::lanes, walked[b].end);
    std::copy_n(ends.transmittance + at, Blocks::lanes, walked[b].transmittance);
  }
  ToBlocks(rows_upstream.red, &WalkedBlock::red, walked);
  ToBlocks(rows_upstream.green, &WalkedBlock::green, walked);
  ToBlocks(rows_upstream.blue, &WalkedBlock::blue, walked);
  if constexpr (kDepth) ToBlocks(rows_upstream.depth, &WalkedBlock::depth, walked);
  ToBlocks(rows_upstream.transmittance, &WalkedBlock::beyond, walked);
  Batch batch;
  ReachedBlocks reached;
  for (std::size_t b = (passed + Batch::size - 1) / Batch::size; b-- > asked / Batch::size;) {
    const std::size_t first = b * Batch::size, n = HWY_MIN(Batch::size, passed - first);
    Fill(splats, list + first, n, x0, y0, batch);
    if (b > asked / Batch::size)
      for (std::size_t k = first - Batch::size; k < first; ++k) hwy::Prefetch(&splats[list[k]]);
    std::int32_t ends_from_here[Blocks::count];
    for (std::size_t i = 0; i < Blocks::count; ++i) ends_from_here[i] = block_ends[i] - std::int32_t(first);
    FindReachedBlocks(d, n, batch, ends_from_here, reached);
    const std::uint64_t bits_asked = asked > first ? ~std::uint64_t{0} << (asked - first) : ~std::uint64_t{0};
    WalkBack<kDepth>(d, first, batch, reached, bits_asked, Changeable(pair_of_entry + first, n), walked,
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
