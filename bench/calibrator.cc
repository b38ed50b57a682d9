#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "bench/calibrator.cc"
#include <benchmark/benchmark.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <atomic>
#include <thread>

#include "bench/calibrator.h"
#include "engine/core/parallel.h"

HWY_BEFORE_NAMESPACE();
namespace bench {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::ScalableTag<float>;
using V = hn::Vec<D>;

/// The renderer's own, but for AVX-512, where it has since become cheaper: the measure stays.
HWY_INLINE V Exp2(D d, V x) {
  const hn::RebindToSigned<D> di;
  const V shift = hn::Set(d, 12582912.0f);
  const V shifted = hn::Add(x, shift);
  const V f = hn::Sub(x, hn::Sub(shifted, shift));
  V p = hn::Set(d, 0.001327647198f);
  p = hn::MulAdd(p, f, hn::Set(d, 0.009675541334f));
  p = hn::MulAdd(p, f, hn::Set(d, 0.05550713274f));
  p = hn::MulAdd(p, f, hn::Set(d, 0.2402211972f));
  p = hn::MulAdd(p, f, hn::Set(d, 0.6931469671f));
  p = hn::MulAdd(p, f, hn::Set(d, 1.000000072f));
  return hn::BitCast(d, hn::Add(hn::BitCast(di, p), hn::ShiftLeft<23>(hn::BitCast(di, shifted))));
}

struct Rays {
  V transmittance, red, green, blue, power;
};

HWY_INLINE void Blend(D d, Rays& rays, V slope) {
  rays.power = hn::Mul(rays.power, slope);  // stays within the range that is blended, yet is never known beforehand
  V alpha = hn::Min(Exp2(d, rays.power), hn::Set(d, 0.99f));
  alpha = hn::IfThenElseZero(hn::Ge(alpha, hn::Set(d, 1.0f / 255.0f)), alpha);
  const V w = hn::Mul(rays.transmittance, alpha);
  rays.red = hn::MulAdd(w, hn::Set(d, 0.3f), rays.red);
  rays.green = hn::MulAdd(w, hn::Set(d, 0.5f), rays.green);
  rays.blue = hn::MulAdd(w, hn::Set(d, 0.7f), rays.blue);
  // The floor stands for the test of the early end, and keeps the loop away from denormals, which no renderer meets.
  rays.transmittance = hn::Max(hn::Sub(rays.transmittance, w), hn::Set(d, 1e-4f));
}

/// One thread's share. Two vectors: with more, 16 registers do not hold their state; with fewer, latency shows.
float BlendInRegisters(std::uint64_t steps, std::uint64_t* pairs) {
  const D d;
  auto fresh = [&](float power) {
    return Rays{hn::Set(d, 1.0f), hn::Zero(d), hn::Zero(d), hn::Zero(d),
                hn::Add(hn::Set(d, power), hn::Mul(hn::Iota(d, 0), hn::Set(d, -0.1f)))};
  };
  Rays a = fresh(-0.5f), b = fresh(-0.7f);
  const V slope = hn::Set(d, 1.0f + 1e-7f * float(steps & 1));
  for (std::uint64_t i = 0; i < steps; ++i) {
    Blend(d, a, slope);
    Blend(d, b, slope);
  }
  *pairs = steps * 2 * hn::Lanes(d);
  const V sum = hn::Add(hn::Add(a.red, a.green), hn::Add(b.blue, hn::Add(b.red, a.transmittance)));
  return hn::GetLane(hn::SumOfLanes(d, sum));
}

}  // namespace HWY_NAMESPACE
}  // namespace bench
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bench {

HWY_EXPORT(BlendInRegisters);

std::uint64_t blend_in_registers(std::uint64_t steps) {
  const std::size_t threads = std::thread::hardware_concurrency();
  std::atomic<std::uint64_t> total{0};
  engine::parallel_for(threads, 1, [&](std::size_t, std::size_t) {
    std::uint64_t pairs = 0;
    benchmark::DoNotOptimize(HWY_DYNAMIC_DISPATCH(BlendInRegisters)(steps, &pairs));
    total += pairs;
  });
  return total;
}

}  // namespace bench
#endif
