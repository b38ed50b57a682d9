// Pulls back the blending of one tile, a vector of pixels at a time, from where its rays ended.
#include <hwy/cache_control.h>
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/render/simd/composite_tile_vjp.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After highway.h: compiled once per instruction set.
#include "engine/render/simd/lane_sums.inc"
#include "engine/render/simd/tile_blocks.inc"

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
  /// dL/dT of that splat and all that lies farther back, T being what reached it. At first background . color - alpha.
  float beyond[Blocks::lanes];
};

/// A splat's sums over pixels, one lane each.
struct Sums {
  V g, along, across, along_along, along_across, across_across, red, green, blue, depth;
};

#if HWY_TARGET == HWY_SCALAR
HWY_INLINE void AddGradient(D /*d*/, const Sums& sums, GroupGradient& to) {
  to.g += hn::GetLane(sums.g);
  to.along += hn::GetLane(sums.along), to.across += hn::GetLane(sums.across);
  to.along_along += hn::GetLane(sums.along_along);
  to.along_across += hn::GetLane(sums.along_across);
  to.across_across += hn::GetLane(sums.across_across);
  to.red += hn::GetLane(sums.red), to.green += hn::GetLane(sums.green), to.blue += hn::GetLane(sums.blue);
  to.depth += hn::GetLane(sums.depth);
}
#else
/// Sums over the lanes; all of them together, since shuffles are what this costs.
HWY_INLINE void AddGradient(D d, const Sums& sums, GroupGradient& to) {
  const hn::FixedTag<float, 4> d4;
  float* const floats = &to.g;  // the members of GroupGradient, in order
  const auto add = [&](auto fours, float* at) { hn::StoreU(hn::Add(hn::LoadU(d4, at), fours), d4, at); };
  add(SumBlocks(d, SumFours(d, sums.g, sums.along, sums.across, sums.along_along)), floats);
  add(SumBlocks(d, SumFours(d, sums.along_across, sums.across_across, sums.red, sums.green)), floats + 4);
  const auto twos = SumBlocks(
      d, hn::Add(hn::InterleaveLower(d, sums.blue, sums.depth), hn::InterleaveUpper(d, sums.blue, sums.depth)));
  add(hn::Add(twos, hn::Shuffle1032(twos)), floats + 8);  // and once more, over the padding
}
#endif

/// Where the gradients of a batch's splats go.
struct BatchPairs {
  std::uint32_t number[Batch::size];  ///< Of those that may change.
  std::uint64_t changeable;           ///< Bit k: splat k may change.
};

/// Finds them for a batch of n splats, and asks for them.
HWY_INLINE void FindPairs(const Splat* splats, const std::uint32_t* list, const TilePairs& pairs, std::size_t n,
                          BatchPairs& out) {
  out.changeable = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const PairsOfSplat& of = splats[list[k]].pairs;
    if (!of.any()) continue;
    out.changeable |= std::uint64_t{1} << k;
    out.number[k] = pairs.pairs_before[list[k] / project_block] + of.number(pairs.group_column, pairs.group_row);
    const GroupGradient& pair = pairs.sums[out.number[k]];
    hwy::Prefetch(&pair.g), hwy::Prefetch(&pair.padding[1]);  // often in two lines
  }
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

/// The blocks that splat k of a batch reaches, one after the other.
class BlocksOf {
 public:
  HWY_INLINE BlocksOf(const ReachedBlocks& reached, std::size_t k)
      : reached_(&reached), k_(k), bits_(reached.bits[0][k]) {
    ToNextWord();
  }
  [[nodiscard]] HWY_INLINE bool Any() const { return bits_ != 0; }
  /// The next one; there is one.
  HWY_INLINE std::size_t Next() {
    const std::size_t block = 32 * word_ + hwy::Num0BitsBelowLS1Bit_Nonzero32(bits_);
    bits_ &= bits_ - 1;
    ToNextWord();
    return block;
  }

 private:
  HWY_INLINE void ToNextWord() {
    if constexpr (ReachedBlocks::words > 1)
      while (bits_ == 0 && word_ + 1 < ReachedBlocks::words) bits_ = reached_->bits[++word_][k_];
  }

  const ReachedBlocks* reached_;
  std::size_t k_, word_ = 0;
  std::uint32_t bits_;  ///< Left of the word.
};

/// A splat where a block's rays meet it.
struct Meeting {
  WalkedBlock* block;
  V alpha;  ///< Zero where it is not blended.
  V u, v;   ///< See Batch.
};

///   number  of the splat in the tile's list; k: in the batch
template <bool kClamped>
HWY_INLINE Meeting Meet(D d, const Batch& batch, std::size_t k, std::size_t number, WalkedBlock& block) {
  const hn::RebindToSigned<D> di;
  V u, v;
  const V power = PowerAt(d, batch, k, hn::Load(d, block.x), hn::Load(d, block.y), u, v);
  const auto before_end = hn::RebindMask(d, hn::Lt(hn::Set(di, std::int32_t(number)), hn::Load(di, block.end)));
  return {&block, AlphaOf<kClamped>(d, power, PassesCut(d, power, before_end)), u, v};
}

/// What a splat looks like, in all lanes.
struct ShadeOfAll {
  V red, green, blue, depth;
};

/// Takes the rays back to before the splat. The pullbacks are blend_vjp() and falloff_vjp() of blend.h, one of them in
/// another form: with X = dL/dT of what lies beyond, per unit of transmittance,
///   dL/dalpha = T (v_weight - X),   X <- X + alpha (v_weight - X),
/// and T alpha is the weight. T comes by division, which costs less than keeping each of them on the way there.
///   kChanges  false: nothing is summed
template <bool kDepth, bool kChanges, bool kClamped>
HWY_INLINE void StepBack(D d, const Meeting& at, const ShadeOfAll& shade, Sums& sums) {
  WalkedBlock& block = *at.block;
  const V one = hn::Set(d, 1.0f), ceiling = hn::Set(d, float(max_alpha));
  const V v_red = hn::Load(d, block.red), v_green = hn::Load(d, block.green), v_blue = hn::Load(d, block.blue);
  const V transmittance = hn::Div(hn::Load(d, block.transmittance), hn::Sub(one, at.alpha));
  hn::Store(transmittance, d, block.transmittance);
  const V beyond = hn::Load(d, block.beyond);
  V gain = hn::MulAdd(shade.red, v_red, hn::MulAdd(shade.green, v_green, hn::MulSub(shade.blue, v_blue, beyond)));
  if constexpr (kDepth) gain = hn::MulAdd(shade.depth, hn::Load(d, block.depth), gain);
  hn::Store(hn::MulAdd(at.alpha, gain, beyond), d, block.beyond);
  if constexpr (!kChanges) return;
  const V weight = hn::Mul(transmittance, at.alpha);
  V g = hn::Mul(weight, gain);
  if constexpr (kClamped) g = hn::IfThenElseZero(hn::Lt(at.alpha, ceiling), g);
  const V gu = hn::Mul(g, at.u), gv = hn::Mul(g, at.v);
  sums.g = hn::Add(sums.g, g), sums.along = hn::Add(sums.along, gu), sums.across = hn::Add(sums.across, gv);
  sums.along_along = hn::MulAdd(gu, at.u, sums.along_along);
  sums.along_across = hn::MulAdd(gu, at.v, sums.along_across);
  sums.across_across = hn::MulAdd(gv, at.v, sums.across_across);
  sums.red = hn::MulAdd(weight, v_red, sums.red), sums.green = hn::MulAdd(weight, v_green, sums.green);
  sums.blue = hn::MulAdd(weight, v_blue, sums.blue);
  if constexpr (kDepth) sums.depth = hn::MulAdd(weight, hn::Load(d, block.depth), sums.depth);
}

/// k, but the compiler does not know. It would else keep what a batch tells of splat k in all lanes of registers, more
/// than there are: it writes them to the stack for every splat, to read them from there no faster than from the batch.
HWY_INLINE std::size_t Forgotten(std::size_t k) {
  asm volatile("" : "+r"(k));
  return k;
}

/// Walks all rays back through a batch, splat by splat: a splat's sums stay in registers. Each step finds where the
/// next one is to be, of the next splat if need be, before it is taken: one depends on the other in nothing, so that
/// the processor has two chains to follow.
///   first        number of the batch's first splat in the tile's list
///   asked        bits of the splats that are asked for: in front of them nothing may change
///   batch_pairs  where in sums_of_pairs their gradients go
///   walked       [Blocks::count]
template <bool kDepth>
HWY_INLINE void WalkBack(D d, std::size_t first, const Batch& batch, const ReachedBlocks& reached, std::uint64_t asked,
                         const BatchPairs& batch_pairs, WalkedBlock* walked, GroupGradient* sums_of_pairs) {
  std::uint64_t rest = reached.met & asked;
  if (rest == 0) return;
  const auto farthest = [](std::uint64_t bits) { return hwy::Num0BitsAboveMS1Bit_Nonzero64(bits) ^ 63; };
  const V zero = hn::Zero(d);
  std::size_t k = farthest(rest);
  BlocksOf blocks(reached, k);
  Meeting at = Meet<true>(d, batch, k, first + k, walked[blocks.Next()]);
  while (rest != 0) {
    const std::uint64_t bit = std::uint64_t{1} << k;
    rest ^= bit;
    const std::size_t next_k = rest != 0 ? farthest(rest) : k;  // at the end once more, for nothing
    BlocksOf next_blocks(reached, next_k);
    const Shade& one = batch.shade[k];
    const ShadeOfAll shade{hn::Set(d, one.red), hn::Set(d, one.green), hn::Set(d, one.blue), hn::Set(d, one.depth)};
    Sums sums{zero, zero, zero, zero, zero, zero, zero, zero, zero, zero};
    const auto walk = [&](auto changes, auto clamped) {
      while (blocks.Any()) {
        const std::size_t same = Forgotten(k);
        const Meeting next = Meet<clamped>(d, batch, same, first + same, walked[blocks.Next()]);
        StepBack<kDepth, changes, clamped>(d, at, shade, sums);
        at = next;
      }
      const Meeting next = Meet<true>(d, batch, next_k, first + next_k, walked[next_blocks.Next()]);
      StepBack<kDepth, changes, clamped>(d, at, shade, sums);
      at = next;
    };
    if ((batch_pairs.changeable & bit) == 0) {
      walk(std::false_type(), std::true_type());
    } else {
      if (batch.log2_opacity[k] > unclamped_log2_opacity) {
        walk(std::true_type(), std::true_type());
      } else {
        walk(std::true_type(), std::false_type());
      }
      AddGradient(d, sums, sums_of_pairs[batch_pairs.number[k]]);
    }
    k = next_k, blocks = next_blocks;
  }
}

/// A plane of a tile to its blocks; zero if it is null.
HWY_INLINE void ToBlocks(const float* plane, std::ptrdiff_t stride, float (WalkedBlock::*to)[Blocks::lanes],
                         WalkedBlock* walked) {
  const auto pixels = [&](std::size_t at) { return walked[at / Blocks::lanes].*to + at % Blocks::lanes; };
  if (plane == nullptr)
    EachBlockRow([&](std::size_t at, std::size_t, std::size_t) { std::fill_n(pixels(at), Blocks::width, 0.0f); });
  else
    EachBlockRow([&](std::size_t at, std::size_t x, std::size_t y) {
      std::copy_n(plane + std::ptrdiff_t(y) * stride + x, Blocks::width, pixels(at));
    });
}

template <bool kDepth>
void WalkTile(const Splat* splats, const std::uint32_t* list, [[maybe_unused]] std::size_t count, std::size_t asked,
              int x0, int y0, const TileUpstream& upstream, Vec3 background, const RayEnds& ends,
              const TilePairs& pairs) {
  const D d;
  const hn::RebindToSigned<D> di;
  std::int32_t block_ends[Blocks::count];  // the farthest of its rays
  for (std::size_t block = 0; block < Blocks::count; ++block)
    block_ends[block] = hn::GetLane(hn::MaxOfLanes(di, hn::Load(di, ends.end + block * Blocks::lanes)));
  const auto passed = std::size_t(*std::max_element(block_ends, block_ends + Blocks::count));
  assert(passed <= count);  // or the ends are of another picture
  if (asked >= passed) return;

  WalkedBlock walked[Blocks::count];
  ToBlocks(upstream.red, upstream.stride, &WalkedBlock::red, walked);
  ToBlocks(upstream.green, upstream.stride, &WalkedBlock::green, walked);
  ToBlocks(upstream.blue, upstream.stride, &WalkedBlock::blue, walked);
  if constexpr (kDepth) ToBlocks(upstream.depth, upstream.stride, &WalkedBlock::depth, walked);
  ToBlocks(upstream.alpha, upstream.stride, &WalkedBlock::beyond, walked);
  for (std::size_t b = 0, at = 0; b < Blocks::count; ++b, at += Blocks::lanes) {
    WalkedBlock& block = walked[b];
    hn::Store(hn::Load(d, places.x + at), d, block.x);
    hn::Store(hn::Load(d, places.y + at), d, block.y);
    hn::Store(hn::Load(di, ends.end + at), di, block.end);
    hn::Store(hn::Load(d, ends.transmittance + at), d, block.transmittance);
    const V behind = hn::MulAdd(hn::Set(d, background.x), hn::Load(d, block.red),
                                hn::MulAdd(hn::Set(d, background.y), hn::Load(d, block.green),
                                           hn::Mul(hn::Set(d, background.z), hn::Load(d, block.blue))));
    hn::Store(hn::Sub(behind, hn::Load(d, block.beyond)), d, block.beyond);
  }
  Batch batch;
  ReachedBlocks reached;
  BatchPairs batch_pairs;
  for (std::size_t b = (passed + Batch::size - 1) / Batch::size; b-- > asked / Batch::size;) {
    const std::size_t first = b * Batch::size, n = HWY_MIN(Batch::size, passed - first);
    Fill(splats, list + first, n, x0, y0, batch);
    if (b > asked / Batch::size)
      for (std::size_t k = first - Batch::size; k < first; ++k) hwy::Prefetch(&splats[list[k]]);
    FindPairs(splats, list + first, pairs, n, batch_pairs);
    std::int32_t ends_from_here[Blocks::count];
    for (std::size_t i = 0; i < Blocks::count; ++i) ends_from_here[i] = block_ends[i] - std::int32_t(first);
    FindReachedBlocks(d, n, batch, ends_from_here, reached);
    const std::uint64_t bits_asked = asked > first ? ~std::uint64_t{0} << (asked - first) : ~std::uint64_t{0};
    WalkBack<kDepth>(d, first, batch, reached, bits_asked, batch_pairs, walked, pairs.sums);
  }
}

void CompositeTileVjp(const Splat* splats, const std::uint32_t* list, std::size_t count, std::size_t asked, int x0,
                      int y0, const TileUpstream& upstream, Vec3 background, const RayEnds& ends,
                      const TilePairs& pairs) {
  if (upstream.depth != nullptr) {
    WalkTile<true>(splats, list, count, asked, x0, y0, upstream, background, ends, pairs);
  } else {
    WalkTile<false>(splats, list, count, asked, x0, y0, upstream, background, ends, pairs);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::render {

HWY_EXPORT(CompositeTileVjp);

void composite_tile_vjp(const Splat* splats, std::span<const std::uint32_t> list, std::size_t asked, int x0, int y0,
                        const TileUpstream& upstream, Vec3 background, const RayEnds& ends, const TilePairs& pairs) {
  HWY_DYNAMIC_DISPATCH(CompositeTileVjp)
  (splats, list.data(), list.size(), asked, x0, y0, upstream, background, ends, pairs);
}

}  // namespace engine::render
#endif
