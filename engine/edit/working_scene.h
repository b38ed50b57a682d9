// The scene while it is edited: the input's rows, then the copies an edit makes, with the columns the edit needs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/soa.h"
#include "engine/deform/assign.h"
#include "engine/edit/request.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/overlay.h"

namespace engine::edit {

/// What a row is to the edit. All but `frozen` make up the 3D mask M.
enum class Role : std::uint8_t {
  frozen,    ///< Outside M: is never changed.
  held,      ///< An input row of P_h that has not moved yet.
  original,  ///< An input row whose copy has left; its opacity was lowered.
  copy,      ///< A deformed copy at its latest place, in P_h.
  trail,     ///< Not the input's and not in P_h: a copy that was copied in turn, in an extend, its opacity lowered; or
             ///< a child that the optimisation gave an original.
  seed,      ///< New, of the repair: a surface that nobody has seen goes on there. So are its children.
};

/// Rows [0, input_rows) are the input's, in its order; the rest are copies in the order they were made.
struct WorkingScene {
  DVec3 origin{0.0};  ///< x_in_world = x_in_cloud + origin. Zero unless the handles are far away.
  std::size_t input_rows = 0;
  scene::GaussianCloud cloud;   ///< In the frame of `origin`.
  deform::HandleColumn handle;  ///< Handle number + 1 for members of P_h, else 0.
  std::vector<Role> role;
  std::vector<std::uint32_t> parent;  ///< Input row each row comes from.
  Array3 mean_at_deform;              ///< Of members of P_h: where they were before the interval's deformation.
};

/// The input with its rows assigned: one copy of the cloud.
/// The frame is the world's own, unless the handles lie far from its origin compared with their extent. Then it is
/// centred on them, at a point with float coordinates, so that the means near the handles carry over exactly.
[[nodiscard]] WorkingScene begin(const scene::GaussianCloud& input, const Request& request,
                                 const deform::HandleColumn& handle);

/// Undoes everything since begin(): copies go, opacities and memberships are as they were.
void rewind(WorkingScene& working, const scene::GaussianCloud& input, const deform::HandleColumn& handle);

/// Rows that belong to P_h, ascending.
[[nodiscard]] std::vector<std::uint32_t> dragged_rows(const WorkingScene& working);

/// Rows of M, ascending.
[[nodiscard]] std::vector<std::uint32_t> member_rows(const WorkingScene& working);

/// Those of `rows` that are the input's, as begin() took them over.
[[nodiscard]] scene::GaussianCloud as_begun(const WorkingScene& working, const scene::GaussianCloud& input,
                                            std::span<const std::uint32_t> rows);

/// Row `a` of `from`, everything included, in place of row `b` of `to`. Same degree and extra bytes.
void copy_row(const scene::GaussianCloud& from, std::size_t a, scene::GaussianCloud& to, std::size_t b);

/// A camera of the world, for rendering `cloud`.
[[nodiscard]] scene::Camera in_frame_of(const WorkingScene& working, scene::Camera camera);

/// A working scene as its user gets it.
struct Published {
  scene::Overlay overlay;      ///< Over the input: rows that changed and stay; then new ones, as they were made.
  std::size_t changeable = 0;  ///< Rows of M among the output's.
  std::size_t faint = 0;       ///< Copies left out because they are too faint to be seen.
};

/// What an edit has come to. Surviving input rows are the input's bytes, but for those of M that the edit changed.
/// In a move, originals whose opacity has not risen above the one they were lowered to are left out, and so is what
/// else of M the edit has made or changed and is too faint to be seen (opacity below 1/255). Rows the edit has not
/// changed always stay, however faint.
[[nodiscard]] Published publish(const WorkingScene& working, const scene::GaussianCloud& input, Mode mode);

}  // namespace engine::edit
