// Distances of patches, and the search that asks for them.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/correct/patch_field_simd.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>

#include "engine/core/rng.h"
#include "engine/correct/patch_field_simd.h"

HWY_BEFORE_NAMESPACE();
namespace engine::correct {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t padded_side = 8;  // a row of a patch and one pixel that counts nothing
using D = hn::CappedTag<float, padded_side>;

/// A patch of the target, as it is compared.
struct Query {
  alignas(64) float color[3][patch_side][padded_side];
  alignas(64) float weight[patch_side][padded_side];  ///< Divided by their sum.

  HWY_INLINE void Load(const PatchQuery& query, Pixel centre) {
    const Planes& target = *query.target;
    const std::size_t corner = target.index(centre.x - patch_radius, centre.y - patch_radius);
    float sum = 0;
    for (std::size_t row = 0; row < std::size_t(patch_side); ++row) {
      const std::size_t at = corner + row * std::size_t(target.width);
      for (std::size_t c = 0; c < 3; ++c)
        std::copy_n(target.data.data() + c * target.pixels() + at, padded_side, color[c][row]);
      std::copy_n(query.weight.data() + at, padded_side, weight[row]);
      weight[row][padded_side - 1] = 0;
      for (const float w : weight[row]) sum += w;
    }
    const float scale = sum > 0 ? 1 / sum : 0;
    for (auto& row : weight)
      for (float& w : row) w *= scale;
  }

  /// Distance to the patch around `centre` if it is below `bound`; otherwise some number that is not below it.
  HWY_INLINE float Distance(const Planes& source, Pixel centre, float bound) const {
    const D d;
    const float* const corner = source.data.data() + source.index(centre.x - patch_radius, centre.y - patch_radius);
    auto sum = hn::Zero(d);
    float distance = 0;
    for (std::size_t row = 0; row < std::size_t(patch_side); ++row) {
      const float* const at = corner + row * std::size_t(source.width);
      for (std::size_t lane = 0; lane < padded_side; lane += hn::Lanes(d)) {
        const auto w = hn::Load(d, weight[row] + lane);
        for (std::size_t c = 0; c < 3; ++c) {
          const auto difference =
              hn::Sub(hn::Load(d, color[c][row] + lane), hn::LoadU(d, at + c * source.pixels() + lane));
          sum = hn::MulAdd(w, hn::Mul(difference, difference), sum);
        }
      }
      if (row == 2 || row == patch_side - 1) {  // most candidates are hopeless after three rows
        distance = hn::GetLane(hn::SumOfLanes(d, sum));
        if (distance >= bound) return distance;
      }
    }
    return distance;
  }
};

void ImproveRange(const PatchQuery& query, std::span<const PatchMatch> matches, int step, std::uint64_t seed,
                  std::size_t begin, std::size_t end, std::span<PatchMatch> out) {
  const Planes& target = *query.target;
  Query patch;
  for (std::size_t k = begin; k < end; ++k) {
    const Pixel here = query.centres[k];
    patch.Load(query, here);
    PatchMatch best = matches[k];
    best.distance = patch.Distance(query.sources[best.source].picture, best.centre, hwy::HighestValue<float>());
    const auto consider = [&](std::uint32_t source_number, int x, int y) {
      const PatchSource& source = query.sources[source_number];
      if (x < patch_radius || y < patch_radius || x >= source.picture.width - patch_radius ||
          y >= source.picture.height - patch_radius || source.centre_allowed.at(x, y) == 0)
        return;
      const Pixel centre{std::int16_t(x), std::int16_t(y)};
      const float distance = patch.Distance(source.picture, centre, best.distance);
      if (distance < best.distance) best = {source_number, centre, distance};
    };
    for (const auto& [dx, dy] : {std::array{-step, 0}, {step, 0}, {0, -step}, {0, step}}) {
      const int x = here.x + dx, y = here.y + dy;
      if (x < 0 || y < 0 || x >= target.width || y >= target.height) continue;
      const std::uint32_t neighbour = query.number[target.index(x, y)];
      if (neighbour == no_centre) continue;
      const PatchMatch& theirs = matches[neighbour];
      consider(theirs.source, theirs.centre.x - dx, theirs.centre.y - dy);
    }
    Rng rng(seed, k);
    const auto around = [&](int radius) {
      const std::uint32_t drawn = rng.next();
      const int span = 2 * radius + 1;
      consider(best.source, best.centre.x - radius + int((drawn & 0xffff) * std::uint32_t(span) >> 16),
               best.centre.y - radius + int((drawn >> 16) * std::uint32_t(span) >> 16));
    };
    around(16), around(4), around(1);
    const std::uint32_t source_number = rng.below(std::uint32_t(query.sources.size()));
    const PatchSource& source = query.sources[source_number];
    if (!source.centres.empty()) {
      const std::uint32_t pixel = source.centres[rng.below(std::uint32_t(source.centres.size()))];
      consider(source_number, int(pixel % std::uint32_t(source.picture.width)),
               int(pixel / std::uint32_t(source.picture.width)));
    }
    out[k] = best;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace engine::correct
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace engine::correct {

HWY_EXPORT(ImproveRange);

void improve_range(const PatchQuery& query, std::span<const PatchMatch> matches, int step, std::uint64_t seed,
                   std::size_t begin, std::size_t end, std::span<PatchMatch> out) {
  HWY_DYNAMIC_DISPATCH(ImproveRange)(query, matches, step, seed, begin, end, out);
}

}  // namespace engine::correct
#endif
