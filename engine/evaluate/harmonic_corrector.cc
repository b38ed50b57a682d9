#include "engine/evaluate/harmonic_corrector.h"

#include "engine/correct/harmonic.h"

namespace engine::evaluate {

Result<void> HarmonicCorrector::fine_tune(std::span<const correct::Example> /*buffer*/, int /*steps*/) { return {}; }

Result<std::vector<scene::Image>> HarmonicCorrector::correct(std::span<const correct::CorrectionTask> views,
                                                             double /*strength*/, std::uint64_t /*seed*/) {
  std::vector<scene::Image> out;
  for (const correct::CorrectionTask& flawed : views) {
    out.push_back(flawed.picture);
    correct::fill_harmonic(out.back(), correct::pixels_to_correct(flawed));
  }
  return out;
}

}  // namespace engine::evaluate
