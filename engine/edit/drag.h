// The deformation of an edit, interval by interval, without a look at any picture.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/deform/assign.h"
#include "engine/deform/deform.h"
#include "engine/edit/request.h"
#include "engine/edit/working_scene.h"

namespace engine::edit {

/// P_h^i of every handle of the request.
///   errors  unprocessable: a handle without Gaussians; `where` names it
[[nodiscard]] Result<deform::Assignment> assign(const Array3& mean, const Request& request);

/// What an interval will do to P_h, before it is done.
struct Step {
  std::vector<std::uint32_t> rows;    ///< P_h, ascending.
  deform::Deformation deformation;    ///< Of `rows`.
  std::vector<std::uint32_t> moving;  ///< Those of `rows` that move, ascending.
};

/// The deformation of interval u = 1..intervals, from the handles' present positions.
[[nodiscard]] Step plan_step(const WorkingScene& working, const Request& request, std::span<const DVec3> positions,
                             int u, int intervals);

/// Where a whole drag has led.
struct DragResult {
  std::vector<std::uint32_t> copies;  ///< Rows of the copies at their final place, ascending.
  std::vector<DVec3> positions;       ///< Of the handles, in the frame of the working scene.
  std::vector<std::string> warnings;
};

/// All intervals one after the other: deform, copy and paste, relocate.
///   rotate_sh  false where only shapes matter
DragResult drag_through(WorkingScene& working, const Request& request, int intervals, bool rotate_sh);

}  // namespace engine::edit
