#include "engine/evaluate/harmonic_corrector.h"

#include "engine/correct/harmonic.h"

namespace engine::evaluate {

Result<void> HarmonicCorrector::fine_tune(std::span<const correct::Example> /*buffer*/, int /*steps*/) { return {}; }

Result<std::vector<scene::Image>> HarmonicCorrector::correct(std::span<const correct::Flawed> views,
                                                             double /*strength*/, std::uint64_t /*seed*/) {
  std::vector<scene::Image> out;
  for (const correct::Flawed& flawed : views) {
    out.push_back(flawed.picture);
    correct::fill_harmonic(out.back(), correct::flaws_of(flawed));
  }
  return out;
}

}  // namespace engine::evaluate
