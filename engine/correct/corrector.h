// What repairs the pictures of an edit: it replaces, inside each view's mask, what cannot be trusted.
// Source: 3DGS-Drag (ICLR 2025), section 3.4, where a fine-tuned diffusion model does it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/scene/image.h"

namespace engine::correct {

/// A picture of the buffer, from which a corrector learns what the scene looks like.
struct Example {
  scene::Image picture;  ///< [3]
  /// Pixels that must not be learned from, in the picture's size: in a move, the part at the place that it leaves.
  scene::Mask excluded;
  scene::Rect box;  ///< Where the edit is in this picture.
};

/// A picture that wants correcting.
struct Flawed {
  scene::Image picture;  ///< [3]
  scene::Mask mask;      ///< Only these pixels may change.
  /// [1] How far what a pixel shows was really observed: 1 fully, it stays; 0 not at all, it says nothing; in between
  /// it is a hint.
  scene::Image trust;
  std::vector<std::size_t> examples;  ///< Of the buffer, the most alike first.
};

/// A pixel of at least this trust stays as it is.
constexpr float trusted = 0.9f;

/// The pixels that want correcting: within the mask, and not trusted.
[[nodiscard]] inline scene::Mask flaws_of(const Flawed& flawed) {
  scene::Mask flaws = flawed.mask;
  for (std::size_t i = 0; i < flaws.data.size(); ++i)
    flaws.data[i] = flaws.data[i] != 0 && flawed.trust.data[i] < trusted;
  return flaws;
}

/// Not for two threads at once.
class Corrector {
 public:
  virtual ~Corrector() = default;

  /// Takes over the buffer.
  ///   buffer  kept by reference until the next call
  ///   steps   of training, for correctors that train
  [[nodiscard]] virtual Result<void> fine_tune(std::span<const Example> buffer, int steps) = 0;

  /// Corrected pictures, one for each. Pixels outside the mask, and trusted ones, are those given.
  ///   strength  S, 0 to 1: how much of what is doubtful is made anew; 1 all of it, 0 nothing
  ///   seed      same seed, same bytes, for any number of threads. The next million are this call's too.
  [[nodiscard]] virtual Result<std::vector<scene::Image>> correct(std::span<const Flawed> views, double strength,
                                                                  std::uint64_t seed) = 0;
};

}  // namespace engine::correct
