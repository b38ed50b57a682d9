// The deformation of an edit alone, at once: what the user sees while placing points.
#pragma once

#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/deform/attach.h"
#include "engine/edit/memory.h"
#include "engine/edit/request.h"
#include "engine/scene/overlay.h"

namespace engine::edit {

struct PreviewOutcome {
  scene::Overlay overlay;           ///< Over the previewed version, as an edit without correction would publish it.
  std::vector<std::size_t> counts;  ///< |P_h^i| per handle.
  std::size_t crumbs = 0;           ///< That go along or away.
  std::vector<DVec3> positions;     ///< Of the handles after the whole drag, world units.
  int intervals = 0;                ///< T
  std::vector<deform::Attachment> parts;  ///< Of Interpolation::arap: how each group moves, and why.
  std::size_t changeable = 0;             ///< Size of M at the end.
  // Seconds, with what the memory has saved: for plans, and no part of the result.
  double assign_seconds = 0;  ///< Of steps 1 and 2.
  double drag_seconds = 0;    ///< Of steps 3 and 4, through all intervals.
  std::vector<std::string> warnings;
};

/// Carries out steps 1 to 4 and 9 of an edit on the dragged Gaussians only: its cost follows P_h, but for one pass over
/// the means. The result equals that of run() with the same request.
///   memory  of this scene: what former previews of the same drag have found out is not computed again
///   errors  those of run()
[[nodiscard]] Result<PreviewOutcome> preview(const scene::LayeredCloud& scene, const Request& request, Memory& memory);
[[nodiscard]] Result<PreviewOutcome> preview(const scene::LayeredCloud& scene, const Request& request);

}  // namespace engine::edit
