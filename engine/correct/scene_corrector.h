// The corrector `scene`: what is missing is put together from patches of the scene's own pictures, coarse to fine.
// Source: Wexler, Shechtman, Irani 2007, "Space-time completion of video", sections 3 and 3.4, with the search of
// Barnes et al. 2009.
#pragma once

#include "engine/correct/corrector.h"

namespace engine::correct {

/// Settings of the corrector `scene`.
struct SceneCorrectorOptions {
  float hint = 0.1f;  ///< Trust from which a pixel is a hint, 0 to 1; below, it says nothing. A choice.
  int sources = 6;    ///< Most examples that a picture takes patches from. A choice.
  int rounds = 4;     ///< Rounds of searching and voting at each scale, 1 or more: docs/experiments/0011 tried six.
  int passes = 2;     ///< Passes of the search in a round, 1 or more: docs/experiments/0011 tried three.
};

/// Fills the untrusted pixels of each picture from patches of its examples. It has no errors.
class SceneCorrector final : public Corrector {
 public:
  explicit SceneCorrector(const SceneCorrectorOptions& options = {}) : options_(options) {}
  [[nodiscard]] Result<void> fine_tune(std::span<const Example> buffer, int steps) override;
  [[nodiscard]] Result<std::vector<scene::Image>> correct(std::span<const CorrectionTask> tasks, double strength,
                                                          std::uint64_t seed) override;

 private:
  SceneCorrectorOptions options_;
  std::span<const Example> buffer_;
};

}  // namespace engine::correct
