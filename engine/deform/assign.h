// Which Gaussians a drag takes along.
// Source: 3DGS-Drag (ICLR 2025), section 3.3, "Drag Deformation"; ties between handles are our decision.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/soa.h"

namespace engine::deform {

/// The reach of one handle. World units.
struct Sphere {
  DVec3 center{0.0};
  double radius = 0;
};

/// Axis-aligned box that limits what may be dragged; `size` is the full edge length. World units.
struct Box {
  DVec3 center{0.0}, size{0.0};
};
/// Is the point in the box, or on a face of it?
[[nodiscard]] bool inside(const Box& box, DVec3 point);

/// Row i of the scene belongs to handle handle[i] - 1; 0: it is not dragged.
using HandleColumn = std::vector<std::uint16_t>;

struct Assignment {
  HandleColumn handle;             ///< [N]
  std::vector<std::size_t> count;  ///< [H] Gaussians of each handle, |P_h^i|.
};

/// P_h^i = the Gaussians with |mean - center| < radius (strictly, in double), inside `region` (its faces included) if
/// there is one. A Gaussian in several spheres belongs to the nearest handle, the lower index if the distances tie.
///   spheres  [H], H < 65536
///   errors   unprocessable, `where` = "handles[2].radius", the first handle without a Gaussian of its own: the message
///            says how far the nearest one is, or that the region or other handles take them all
/// One linear scan, O(N H).
[[nodiscard]] Result<Assignment> assign(const Array3& mean, std::span<const Sphere> spheres,
                                        const std::optional<Box>& region = std::nullopt);

/// Where a selection says what moves: each of its rows that lies inside `region` (if there is one) belongs to the
/// nearest handle, however far that is; the lower index if the distances tie. A handle may be left without a row.
///   rows     ascending, of the scene (asserted)
///   centers  [H], H < 65536
///   errors   unprocessable, `where` = "selection": the region leaves no row
[[nodiscard]] Result<Assignment> assign_selected(const Array3& mean, std::span<const std::uint32_t> rows,
                                                 std::span<const DVec3> centers,
                                                 const std::optional<Box>& region = std::nullopt);

}  // namespace engine::deform
