// What repairs the pictures of an edit: it completes them, inside each view's mask, where they cannot be trusted. What
// repaints them whole is a Repainter (repainter.h).
// Source: 3DGS-Drag (ICLR 2025), section 3.4, where a fine-tuned diffusion model repaints them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/scene/image.h"

namespace engine::correct {

/// A picture from which a corrector learns what the scene looks like.
struct Example {
  scene::Image picture;  ///< [3]
  /// Pixels that must not be learned from, in the picture's size: in a move, the part at the place that it leaves.
  scene::Mask excluded;
  scene::Rect box;  ///< The pixels around the edit in this picture; empty: nothing is learned from it.
};

/// One picture to correct, and what to go by.
struct CorrectionTask {
  scene::Image picture;  ///< [3]
  scene::Mask mask;      ///< Only these pixels may change.
  /// [1] How far what a pixel shows was really observed, 0 to 1. From `trusted` on the pixel stays as it is; at 0 it
  /// says nothing; between the two it is a hint. What a repetition foretells counts as observed.
  scene::Image trust;
  std::vector<std::size_t> examples;  ///< Indices into the buffer of examples, the most alike first.
};

/// A pixel of at least this trust stays as it is. Measured in docs/experiments/0009-repair.md: 0.5, 0.7 and 0.98 cost
/// 6, 4 and 0.2 dB on the case `slide`, and 0.98 costs 4 dB on `lift`.
constexpr float trusted = 0.9f;

/// The pixels that a corrector changes: those within the mask that are not trusted.
[[nodiscard]] inline scene::Mask pixels_to_correct(const CorrectionTask& task) {
  scene::Mask pixels = task.mask;
  for (std::size_t i = 0; i < pixels.data.size(); ++i)
    pixels.data[i] = pixels.data[i] != 0 && task.trust.data[i] < trusted;
  return pixels;
}

/// Corrects pictures of an edit. One thread at a time may use an object.
class Corrector {
 public:
  virtual ~Corrector() = default;

  /// Takes the examples that correct() learns from.
  ///   buffer  kept by reference until the next call
  ///   steps   training steps, for correctors that train
  ///   errors  those of the implementation; SceneCorrector has none
  [[nodiscard]] virtual Result<void> fine_tune(std::span<const Example> buffer, int steps) = 0;

  /// Returns a corrected picture for each task, in their order and of the task's size, [3]. Pixels outside the mask,
  /// and trusted ones, stay as given.
  ///   strength  S, 0 to 1: how much of what is doubtful is made anew; 1 all of it, 0 nothing
  ///   seed      same seed, same bytes, for any number of threads; the next million are this call's too
  ///   errors    those of the implementation; SceneCorrector has none
  [[nodiscard]] virtual Result<std::vector<scene::Image>> correct(std::span<const CorrectionTask> tasks,
                                                                  double strength, std::uint64_t seed) = 0;
};

}  // namespace engine::correct
