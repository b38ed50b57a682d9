// What is drawn: a cloud, or a cloud with changes laid over it that nobody has merged.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/overlay.h"

namespace engine::render {

/// Rows 0 to base->size() are the base's; base->size() + j is row j of `top`. A view: it owns nothing.
/// Invariant: both lists ascend and name rows of the base, `changed` is part of `hidden`, and top has the base's
/// sh_degree and at least as many rows as `changed`.
struct Layers {
  const scene::GaussianCloud* base;
  const scene::GaussianCloud* top = nullptr;    ///< Null: nothing on top.
  std::span<const std::uint32_t> hidden = {};   ///< Rows of the base that are not drawn: removed and changed ones.
  std::span<const std::uint32_t> changed = {};  ///< Rows of the base in whose place the first rows of `top` are.

  /// A plain cloud, the usual case: implicit, so that it can be given wherever layers are asked for.
  Layers(const scene::GaussianCloud& cloud) : base(&cloud) {}

  /// Number of rows, the hidden ones included: the length of arrays of weights.
  [[nodiscard]] std::size_t size() const { return base->size() + (top ? top->size() : 0); }
  /// The number that a row, not a hidden one, has in the merged cloud (scene::flatten()).
  [[nodiscard]] std::uint32_t merged_row(std::size_t row) const;
};

/// A version of a scene, ready to be drawn: keeps it in memory and owns the merged list of hidden rows. Making one
/// costs the length of the overlay's lists.
class DrawnVersion {
 public:
  explicit DrawnVersion(scene::LayeredCloud version);
  [[nodiscard]] const scene::LayeredCloud& version() const { return version_; }
  /// The layers to draw; valid as long as this object.
  [[nodiscard]] Layers layers() const;

 private:
  scene::LayeredCloud version_;
  std::vector<std::uint32_t> hidden_;
};

}  // namespace engine::render
