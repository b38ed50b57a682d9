// The corrector `scene`: what is missing is put together from patches of the scene's own pictures, coarse to fine.
// Source: Wexler, Shechtman, Irani 2007, "Space-time completion of video", sections 3 and 3.4, with the search of
// Barnes et al. 2009.
#pragma once

#include "engine/correct/corrector.h"

namespace engine::correct {

struct SceneCorrectorOptions {
  float hint = 0.1f;  ///< A pixel of less trust says nothing.
  int sources = 6;    ///< Most examples that a picture takes patches from.
  int rounds = 4;     ///< Of searching and voting per scale.
  int passes = 2;     ///< Of the search per round.
};

class SceneCorrector final : public Corrector {
 public:
  explicit SceneCorrector(const SceneCorrectorOptions& options = {}) : options_(options) {}
  [[nodiscard]] Result<void> fine_tune(std::span<const Example> buffer, int steps) override;
  [[nodiscard]] Result<std::vector<scene::Image>> correct(std::span<const Flawed> views, double strength,
                                                          std::uint64_t seed) override;

 private:
  SceneCorrectorOptions options_;
  std::span<const Example> buffer_;
};

}  // namespace engine::correct
