// Steps 1 and 3: which Gaussians a drag takes along, and where an interval takes them; and a whole drag without a look
// at any picture.
// Source: 3DGS-Drag (ICLR 2025), sections 3.3 and 3.5.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/deform/assign.h"
#include "engine/deform/deform.h"
#include "engine/edit/parts.h"
#include "engine/edit/request.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/working/working_scene.h"

namespace engine::edit {

using working::WorkingScene;

/// What a request takes along.
struct Taken {
  deform::HandleColumn handle;          ///< [N] P_h^i of every handle.
  std::vector<std::size_t> count;       ///< [H] |P_h^i|
  std::size_t crumbs = 0;               ///< Rows that the selection has left out, and that go along or away.
  std::vector<std::uint32_t> given_up;  ///< Those of them that go away, and no handle has. Ascending.
};

///   memory  of the scene
///   errors  unprocessable: a handle without Gaussians; `where` names it
[[nodiscard]] Result<Taken> assign(const scene::LayeredCloud& scene, const Request& request, Memory& memory);
[[nodiscard]] Result<Taken> assign(const scene::GaussianCloud& scene, const Request& request);

/// What an interval will do to P_h, before it is done.
struct PlannedMotion {
  std::vector<std::uint32_t> rows;    ///< P_h, ascending.
  deform::Deformation deformation;    ///< Of `rows`.
  std::vector<std::uint32_t> moving;  ///< Those of `rows` that move, ascending.
  /// What goes on behind them: copies of rows of the input as they are, shifted.
  std::vector<std::uint32_t> continued;
  std::vector<DVec3> shift;  ///< [continued] world units.
  bool removes = false;      ///< They move nowhere: nothing of them is copied.
};

/// The deformation of interval u = 1..intervals, from the handles' present positions (in the frame of `working`).
///   parts   of the input of `working`
///   memory  of that input
[[nodiscard]] PlannedMotion plan_motion(const WorkingScene& working, const Request& request, const Parts& parts,
                                        std::span<const DVec3> positions, int u, int intervals, Memory& memory);

/// The Gaussians of a drag alone, after it: no step of a drag looks at any other row, and their order stays.
struct DraggedAlone {
  std::vector<std::uint32_t> rows;  ///< Of the scene: its row rows[k] is row k of `working`. Ascending.
  WorkingScene working;             ///< These rows, and the copies that the drag has made of them.
  std::vector<DVec3> positions;     ///< Of the handles, in the frame of `working`.
  std::vector<std::string> warnings;
};

/// All intervals one after the other: deform, copy and paste, relocate. Costs what is dragged, not what there is.
///   rows       of the scene: rows_in_use()
///   gaussians  those rows, of the world
///   handle     [N], of assign()
///   parts      of the scene
///   rotate_sh  false where only shapes matter
///   memory     of the scene
[[nodiscard]] DraggedAlone drag_alone(std::vector<std::uint32_t> rows, const scene::GaussianCloud& gaussians,
                                      std::span<const std::uint16_t> handle, const Request& request, const Parts& parts,
                                      int intervals, bool rotate_sh, Memory& memory);

/// The same of the scene itself, of which only shapes matter: a dry run.
[[nodiscard]] DraggedAlone drag_alone(const scene::GaussianCloud& scene, std::span<const std::uint16_t> handle,
                                      const Request& request, const Parts& parts, int intervals);

}  // namespace engine::edit
