// What a drag edit is asked to do: handles, targets, parameters (engine/params/params.h). Names as in the wire
// contract.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/params/params.h"

namespace engine::edit {

using params::Annealing;
using params::Attach;
using params::Crumbs;
using params::Interpolation;
using params::Mode;
using params::Params;
using params::Rotation;
using params::Settle;
using params::ShadowOfPart;

constexpr std::size_t max_handles = 256;
constexpr double max_scale = 1000;       ///< A choice: far beyond use. Its inverse is the least.
constexpr double max_coordinate = 1e12;  ///< World units; float means would have no digits left for a scene out there.

/// A point of the scene and where it should go.
struct Handle {
  DVec3 source{0.0};            ///< World units, the file's own frame.
  std::optional<DVec3> target;  ///< Nothing, without turn and scale either: an anchor, which holds what is around it.
  /// World units: Gaussians closer to `source` than this are dragged. With a selection: how far the handle grips, which
  /// takes that along as one piece (Interpolation::arap).
  double radius = 0;
  int group = 0;  ///< Handles and Gaussians interpolate within a group only.
  /// How its surroundings turn, about it; w < 0: the long way. None: as suits the part. Any length but 0.
  std::optional<DQuat> rotation = {};
  std::optional<double> scale = {};  ///< How much larger they become. None: 1.

  [[nodiscard]] bool is_anchor() const { return !target && !rotation && !scale; }
  [[nodiscard]] DVec3 end() const { return target.value_or(source); }  ///< Where it is in the end.
};

/// Axis-aligned box that limits what may be dragged.
struct Region {
  DVec3 center{0.0}, size{0.0};  ///< World units; size is the full edge length.
};

struct Request {
  Mode mode = Mode::move;
  std::vector<Handle> handles;  ///< In a removal they only say where, and what is removed if there is no selection.
  /// Rows of the scene that are meant, strictly ascending: each goes with the handle nearest to it, and the radius of a
  /// handle says nothing of what moves. None: the spheres of the handles say it.
  std::optional<std::vector<std::uint32_t>> selected;
  Crumbs crumbs = Crumbs::move;              ///< Of `selected`, in a move or a removal; else there are none.
  ShadowOfPart shadow = ShadowOfPart::move;  ///< Of `selected`, where it leaves its place as a whole.
  Settle settle = Settle::automatic;         ///< Of `selected`, in a move as one piece.
  /// Rows of the scene that are made anew although cameras saw them, strictly ascending: a stain, a painted shadow.
  /// Only with a corrector, and where what is dragged leaves its place; dragged rows among them count where they were.
  std::vector<std::uint32_t> healed;
  std::optional<Region> region;
  Attach attach = Attach::automatic;  ///< What holds the part (Interpolation::arap).
  Params params;
  DVec3 up{0.0, -1.0, 0.0};  ///< World direction that virtual cameras take for up, any length but 0. Default: COLMAP's
                             ///< habit, y down.
};

/// What becomes of the place that the part comes from: `move` or `extend`. A body that is drawn out leaves nothing
/// behind, as in a move: it is what lies between. A ball that is drawn out leaves its trail.
[[nodiscard]] constexpr Mode departure_of(const Request& request) {
  const bool leaves = request.mode == Mode::remove || request.params.interpolation == Interpolation::arap;
  return leaves ? Mode::move : request.mode;
}

/// Ranges and finiteness of every field.
///   errors  invalid_argument: `where` is the address, such as "handles[2].radius" or "params.views"
[[nodiscard]] Result<void> validate(const Request& request);

}  // namespace engine::edit
