// What repaints the pictures of an edit: within each view's mask all is its to change, and deformed copies follow what
// it has painted. A Corrector (corrector.h) completes: what is trusted stays.
// Source: 3DGS-Drag (ICLR 2025), section 3.4, where a diffusion model does it that is fine-tuned on the scene.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/scene/image.h"

namespace engine::correct {

/// A colour picture as it is kept: what is learned from does not depend on whether it was written down meanwhile.
struct BytePicture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> data;  ///< [3][height][width]
  bool operator==(const BytePicture&) const = default;
};
/// Rounds to 8 bits; what is beyond 0 and 1 is clamped, what is not a number becomes 0.
///   picture  [3]
[[nodiscard]] BytePicture as_bytes(const scene::Image& picture);
[[nodiscard]] scene::Image as_image(const BytePicture& picture);

/// Where a picture of the history comes from. Edited ones never take the place of originals.
enum class Origin : std::uint8_t {
  original,  ///< The scene before the edit.
  edited     ///< What was made of a view in an interval of the edit.
};

/// A picture that a repainter learns from. Of originals it is shown the whole, the part that is dragged at its old
/// place included: that is how it learns what the part looks like.
struct HistoryPicture {
  Origin origin = Origin::original;
  int interval = 0;  ///< Of the edit, from 1; 0: before it.
  std::size_t view = 0;
  BytePicture picture;
  scene::Rect box = {};  ///< The pixels around what the edit changes in this view, as of now.
};

/// One picture to repaint.
struct RepaintTask {
  scene::Image picture;  ///< [3] What the scene shows.
  scene::Mask mask;      ///< All of these pixels may change; at least one is set.
};

/// Is told which part of a call is done, 0 to 1, before each step that takes long. The error that it returns ends the
/// call: that is how a call is cancelled.
using Advance = std::function<Result<void>(double part)>;

/// Repaints the views of an edit. One thread at a time may use an object.
class Repainter {
 public:
  virtual ~Repainter() = default;

  /// Goes on learning, from all pictures of the history.
  ///   steps   of training; 0: nothing happens
  ///   seed    of what is left to chance; the next million are this call's too
  ///   errors  those of the implementation and of `advance`, after which it is of no more use
  [[nodiscard]] virtual Result<void> fine_tune(std::span<const HistoryPicture> history, int steps, std::uint64_t seed,
                                               const Advance& advance) = 0;

  /// Repaints all views of a correction; how many at a time is its own business.
  ///   strength  S, 0 to 1: how much is made anew; 1 all of it, 0 nothing
  ///   seed      same seed, same bytes; the next million are this call's too
  ///   returns   a picture for each task, in their order and of the task's size, [3]; outside the masks anything
  ///   errors    those of the implementation and of `advance`
  [[nodiscard]] virtual Result<std::vector<scene::Image>> repaint(std::span<const RepaintTask> tasks, double strength,
                                                                  std::uint64_t seed, const Advance& advance) = 0;

  /// What it has learned so far, as bytes: a repainter that is given them goes on to the same bytes.
  [[nodiscard]] virtual std::string state() const = 0;
  /// errors  corrupt_data, invalid_argument: not what a repainter of these settings has learned; conflict: what it
  ///         works with is not what it was; `where` is "checkpoint"
  [[nodiscard]] virtual Result<void> restore(std::string_view state) = 0;
};

}  // namespace engine::correct
