// Relaxes blocks of nodes. Nothing is fused and every sum has one order, so that all instruction sets round alike.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/repair/relaxation_simd.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/repair/relaxation_simd.h"

HWY_BEFORE_NAMESPACE();
namespace engine::repair {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, block>;
using U = hn::RebindToUnsigned<D>;
using Floats = hn::Vec<D>;
using Rules = hn::Vec<U>;

constexpr float over_relaxation = 1.6f;  // below 2, where it no longer settles: a choice
constexpr std::size_t here = in_stencil({0, 0, 0});

/// Lanes whose rule has this bit.
HWY_INLINE auto Has(Rules rules, Rule bit) { return hn::RebindMask(D(), hn::TestBit(rules, hn::Set(U(), bit))); }

/// The values around as many nodes as a vector holds, by their place in the stencil.
struct Around {
  const Relaxed& grid;
  std::ptrdiff_t node;

  HWY_INLINE Floats operator[](std::size_t k) const { return hn::LoadU(D(), grid.values + (node + grid.step[k])); }
};

/// Half the first derivative of what is minimised by the value of a node: of all differences, the biharmonic operator.
HWY_INLINE Floats SlopeWithin(const Around& at) {
  const D d;
  Floats beside = hn::Zero(d), diagonal = hn::Zero(d), beyond = hn::Zero(d);
  for (const Plane& in : planes) {
    beside = hn::Add(beside, hn::Add(at[in.beside[0]], at[in.beside[1]]));
    const Floats three = hn::Add(hn::Add(at[in.diagonal[0]], at[in.diagonal[1]]), at[in.diagonal[2]]);
    diagonal = hn::Add(diagonal, hn::Add(three, at[in.diagonal[3]]));
    beyond = hn::Add(beyond, hn::Add(at[in.beyond[0]], at[in.beyond[1]]));
  }
  const Floats near = hn::Sub(hn::Mul(hn::Set(d, 42.0f), at[here]), hn::Mul(hn::Set(d, 12.0f), beside));
  return hn::Add(hn::Add(near, hn::Mul(hn::Set(d, 2.0f), diagonal)), beyond);
}

/// The same of those differences alone that count.
HWY_INLINE Floats SlopeAtRim(const Around& at, Rules rules) {
  const D d;
  const Floats two = hn::Set(d, 2.0f);
  Floats slope = hn::Zero(d);
  Rule bit = 1;
  for (const StraightDifference& of : straight_differences) {
    const Floats difference = hn::Add(hn::Sub(at[of.before], hn::Mul(two, at[of.at])), at[of.after]);
    slope = hn::Add(slope, hn::IfThenElseZero(Has(rules, bit), hn::Mul(hn::Set(d, of.share), difference)));
    bit <<= 1;
  }
  for (const MixedDifference& of : mixed_differences) {
    const Floats difference = hn::Add(hn::Sub(hn::Sub(at[here], at[of.first]), at[of.second]), at[of.both]);
    slope = hn::Add(slope, hn::IfThenElseZero(Has(rules, bit), hn::Mul(two, difference)));
    bit <<= 1;
  }
  return slope;
}

/// The one that is due in each lane. One that is due in none is spared: most vectors have no lane at the rim.
HWY_INLINE Floats Slope(const Around& at, Rules rules) {
  const D d;
  const Rules every = hn::Set(U(), every_difference);
  const auto is_all = hn::Eq(hn::And(rules, every), every);
  const auto is_some = hn::AndNot(is_all, hn::Ne(rules, hn::Zero(U())));
  Floats slope = hn::Zero(d);
  if (!hn::AllFalse(U(), is_some)) slope = SlopeAtRim(at, rules);
  if (!hn::AllFalse(U(), is_all)) slope = hn::IfThenElse(hn::RebindMask(d, is_all), SlopeWithin(at), slope);
  return slope;
}

HWY_INLINE Floats Curvature(Rules rules) {
  const Rules bits = hn::And(hn::ShiftRight<curvature_bit>(rules), hn::Set(U(), curvature_mask));
  return hn::ConvertTo(D(), hn::BitCast(hn::RebindToSigned<D>(), bits));
}

HWY_INLINE Floats Bounded(Floats value, Rules rules) {
  const Floats zero = hn::Zero(D());
  value = hn::IfThenElse(hn::And(Has(rules, is_not_negative), hn::Lt(value, zero)), zero, value);
  return hn::IfThenElse(hn::And(Has(rules, is_not_positive), hn::Gt(value, zero)), zero, value);
}

HWY_INLINE void RelaxLanes(const Relaxed& grid, std::size_t node) {
  const D d;
  const Rules rules = hn::LoadU(U(), grid.rules + node);
  const Around at{grid, std::ptrdiff_t(node)};
  Floats slope = Slope(at, rules), curvature = Curvature(rules);
  const Floats value = at[here], pull = hn::Set(d, grid.pull);
  const Floats off = hn::Sub(value, hn::LoadU(d, grid.measured + node));
  const auto known = Has(rules, is_known);
  slope = hn::IfThenElse(known, hn::Add(slope, hn::Mul(pull, off)), slope);
  curvature = hn::IfThenElse(known, hn::Add(curvature, pull), curvature);
  const Floats beyond = hn::Sub(value, hn::Div(hn::Mul(hn::Set(d, over_relaxation), slope), curvature));
  const auto bends = hn::Gt(curvature, hn::Zero(d));  // else too few are around
  hn::StoreU(hn::IfThenElse(bends, Bounded(beyond, rules), value), d, grid.values + node);
}

void RelaxBlocks(const Relaxed& grid, std::span<const std::uint32_t> blocks) {
  for (const std::uint32_t first : blocks)
    for (std::size_t lane = 0; lane < block; lane += hn::Lanes(D())) RelaxLanes(grid, first + lane);
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::repair
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::repair {

HWY_EXPORT(RelaxBlocks);

void relax_blocks(const Relaxed& grid, std::span<const std::uint32_t> blocks) {
  HWY_DYNAMIC_DISPATCH(RelaxBlocks)(grid, blocks);
}

}  // namespace engine::repair
#endif
