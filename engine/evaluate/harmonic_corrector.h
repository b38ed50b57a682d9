// The baseline that a corrector has to beat: what is doubtful is filled smoothly.
#pragma once

#include "engine/correct/corrector.h"

namespace engine::evaluate {

/// Replaces what is not trusted by the harmonic interpolation of what is around it (engine/correct/harmonic.h).
class HarmonicCorrector final : public correct::Corrector {
 public:
  [[nodiscard]] Result<void> fine_tune(std::span<const correct::Example> buffer, int steps) override;
  [[nodiscard]] Result<std::vector<scene::Image>> correct(std::span<const correct::CorrectionTask> views,
                                                          double strength, std::uint64_t seed) override;
};

}  // namespace engine::evaluate
