// The handles of an edit from interval to interval: where they are, where they go, and where their Gaussians took them.
// Source: 3DGS-Drag (ICLR 2025), section 3.5, eq. 7, and "Handle Point Relocation".
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "engine/deform/motion.h"
#include "engine/edit/parts.h"
#include "engine/edit/request.h"
#include "engine/working/frame.h"
#include "engine/working/working_scene.h"

namespace engine::edit {

/// T as the request sets it; or 1 for an elastic body that is moved; or the longest drag over the radius of its handle,
/// in an extend over the diameter.
[[nodiscard]] int resolved_intervals(const Request& request);

/// An elastic body is moved, which finds its whole way at once; or every group is shifted and turned as one piece, no
/// anchor holds a part of it back, and the parameters (`rigid`, by the shortest arc) keep it one piece: one step
/// carries it there. Without handles: false.
[[nodiscard]] bool one_interval_is_exact(const Request& request);

/// The frame in which a drag is carried out: the world's own, unless the handles lie far from its origin compared with
/// their extent. Then it is centred on them, at a point with float coordinates, so that the means near the handles
/// carry over exactly.
[[nodiscard]] working::Frame frame_of(const Request& request);

/// Where the handles are before the first interval.
[[nodiscard]] std::vector<DVec3> handle_sources(const working::Frame& frame, const Request& request);
/// Positions in that frame, in the world.
[[nodiscard]] std::vector<DVec3> in_world(const working::Frame& frame, std::span<const DVec3> positions);

/// What the request asks of its handles, from where they are to where they go: in the world's own frame, or another.
[[nodiscard]] std::vector<deform::Drag> whole_drags(const Request& request, const working::Frame& frame = {});

/// The drags of interval u = 1..T: from where the handles are now to where they shall be then, which is measured from
/// where the user placed them: on the line to the target, or, for an elastic body, on the way that deform::Path
/// takes. The last one ends on the targets exactly.
///   corrected  handles that go elsewhere than to their targets
///   positions  of the handles, in `frame`, as the drags are
[[nodiscard]] std::vector<deform::Drag> interval_drags(const working::Frame& frame, const Request& request,
                                                       std::span<const Parts::Corrected> corrected,
                                                       std::span<const DVec3> positions, int u, int intervals);

/// Gives a radius to handles that have none. For an elastic body, of the longest edge of the box around what is
/// selected, a twentieth, or a quarter for handles that turn or scale what they grip; else half of that edge. A removal
/// without a handle gets one, in the middle of that box.
///   request  with a selection
void give_radii(const scene::Bounds& selected, Request& request);

/// How far the handle grips a part that moves as an elastic body. World units.
[[nodiscard]] double grip_of(const Request& request, const Handle& handle);

/// p_h^i += opacity-weighted mean over the Gaussians of P_h^i of (mean - mean_at_deform): the way they went in this
/// interval, deformation and optimisation together. That may be less than the handle's own dp, because its Gaussians
/// follow its neighbours too; the next interval starts from where the part really is. Of an elastic body only those
/// near the handle count: what it grips, or the nearest one; all of them, where these are invisible. An anchor marks a
/// place, so it stays. A handle none of whose Gaussians is left stays too.
///   returns  the handles that have lost all their Gaussians
std::vector<std::size_t> relocate(const working::WorkingScene& working, const Request& request,
                                  std::vector<DVec3>& positions);

}  // namespace engine::edit
