// A working scene as its user gets it.
#pragma once

#include <cstddef>

#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/overlay.h"
#include "engine/working/mode.h"
#include "engine/working/working_scene.h"

namespace engine::edit {

struct Published {
  scene::Overlay overlay;      ///< Over the input: rows that changed and stay; then new ones, as they were made.
  std::size_t changeable = 0;  ///< Rows of M among the output's.
  std::size_t faint = 0;       ///< Rows left out because they are too faint to be seen, originals not counted.
};

/// What an edit has come to, of the world. Surviving input rows are the input's bytes, but for those of M that the edit
/// changed. In a move, originals and their children stay only if their opacity has clearly risen from the one they were
/// lowered to (0.05 or more: the pictures asked for them), and what else of M the edit has made or changed only if it
/// can be seen (opacity 1/255 or more). Other rows that the edit has not changed always stay, however faint.
[[nodiscard]] Published publish(const working::WorkingScene& working, const scene::GaussianCloud& input,
                                working::Mode mode);

}  // namespace engine::edit
