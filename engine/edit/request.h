// What a drag edit is asked to do: handles, targets, parameters. Names as in the wire contract.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/deform/motion.h"
#include "engine/working/mode.h"

namespace engine::edit {

/// How the strength of a correction falls from the first of an interval to the last, number A.
enum class Annealing {
  linear,  ///< It reaches the final value: S_init - (a - 1) / (A - 1) (S_init - S_final).
  paper,   ///< As printed: (a - 1) / A in its place, so that the final value is never reached.
};

using deform::Interpolation;
using deform::Rotation;
using working::Mode;

constexpr std::size_t max_handles = 256;
constexpr int max_views = 1000;
constexpr double max_coordinate = 1e12;  ///< World units; float means would have no digits left for a scene out there.

/// A point of the scene and where it should go.
struct Handle {
  DVec3 source{0.0};            ///< World units, the file's own frame.
  std::optional<DVec3> target;  ///< Nothing: an anchor, which holds its surroundings in place.
  double radius = 0;            ///< World units: Gaussians closer to `source` than this are dragged.
  int group = 0;                ///< Handles and Gaussians interpolate within a group only.
};

/// Axis-aligned box that limits what may be dragged.
struct Region {
  DVec3 center{0.0}, size{0.0};  ///< World units; size is the full edge length.
};

struct Params {
  int intervals = 0;  ///< T, 1 to 20; 0: from the longest drag over its radius, in an extend over its diameter.
  Rotation rotation = Rotation::shortest_arc;
  Interpolation interpolation = Interpolation::paper;
  bool rotate_sh = true;                   ///< Turn SH bands 1 to 3 with their Gaussian.
  int views = 50;                          ///< Most views an edit looks through, 1 to max_views.
  std::vector<std::string> exclude_views;  ///< Names held back from the choice.
  int iterations = 0;                      ///< Of the optimisation per correction, 0 to 1,000,000; 0: none.
  int annealing_steps = 1;                 ///< A: corrections per interval, 1 to 100.
  double strength_initial = 0.5;           ///< S of an interval's first correction, 0 to 1.
  double strength_final = 0.3;             ///< S of its last one, 0 to 1.
  Annealing annealing = Annealing::linear;
  int max_image_side = 512;  ///< Pixels, of the pictures an edit works on, 16 to 16384.
  std::uint64_t seed = 0;
  bool local_mask = true;  ///< False: the whole picture counts as edited, to measure what the mask is worth. Not on the
                           ///< wire.
  bool optimise_unmoved = false;  ///< For tests: masks and optimises also what no handle moves. Not on the wire.
};

struct Request {
  Mode mode = Mode::move;
  std::vector<Handle> handles;
  std::optional<Region> region;
  Params params;
  DVec3 up{0.0, -1.0, 0.0};  ///< World direction that virtual cameras take for up, any length but 0. Default: COLMAP's
                             ///< habit, y down.
};

/// Ranges and finiteness of every field.
///   errors  invalid_argument: `where` is the address, such as "handles[2].radius" or "params.views"
[[nodiscard]] Result<void> validate(const Request& request);

}  // namespace engine::edit
