// Which Gaussians are meant, as a list of operations on a scene. The members are named as the contract names them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::select {

/// What an operation does with the rows it names.
enum class Op {
  add,        ///< They are selected, too.
  subtract,   ///< They are no longer selected.
  intersect,  ///< All others are no longer selected.
};

/// Which of the rows behind a part of a picture are meant.
enum class Depth {
  visible,  ///< Those that most of what the part shows is made of; see shown_rows().
  through,  ///< All whose mean is projected into it, however deep.
};

// What names rows. Points and lengths are in world units, in the scene's own frame.

/// Rows with |mean - center| < radius.
struct Sphere {
  DVec3 center{0.0};
  double radius = 0;  ///< Above 0.
};

/// Rows whose mean lies in the box, its faces included.
struct Box {
  DVec3 center{0.0};
  DVec3 size{0.0};                     ///< Full edge lengths, above 0.
  DQuat rotation{1.0, 0.0, 0.0, 0.0};  ///< (w, x, y, z), world from box; any length but zero.
};

/// Rows whose mean lies on the side that the normal points to, or in the plane.
struct Plane {
  DVec3 point{0.0};
  DVec3 normal{0.0};  ///< Any length but zero.
};

/// Rows that show within a closed polygon of a picture. One that crosses itself goes by the even-odd rule.
struct Polygon {
  scene::Camera camera;
  std::vector<DVec2> points;  ///< Corners, pixels (COLMAP convention: the first pixel's centre is at 0.5); 3 or more.
  Depth depth = Depth::visible;
};

/// Rows that show within the radius of a line drawn on a picture.
struct Stroke {
  scene::Camera camera;
  std::vector<DVec2> points;  ///< Pixels, as those of a polygon; a single one is a disc.
  double radius = 0;          ///< Pixels, above 0.
  Depth depth = Depth::visible;
};

/// Rows of the thing that the inside points lie on, up to its natural border: see Neighbourhood.
struct Grow {
  std::vector<DVec3> inside;    ///< One or more, on the thing; several say about how large it is (ADRs 41, 54, 72).
  std::vector<DVec3> outside;   ///< On what is not meant; may be empty.
  std::optional<double> reach;  ///< No row farther than this from inside[0] is taken. Above 0.
  bool whole = false;           ///< Rather all of the thing than a part of it that ends as sharply: see BorderChoice.
  int wider = 0;  ///< So many natural borders farther out than that of the whole; below 0: in. 0 without `whole`.
  bool operator==(const Grow&) const = default;
};

/// Which pixels of a view belong to the thing.
struct MaskedView {
  scene::Camera camera;
  scene::Mask image;  ///< 1 where they do; of the camera's size.
};

/// Rows that the masks' views show more of inside the masks than outside (see rows_in_masks()), and those that no view
/// shows well but that hang together with such.
struct Masks {
  std::vector<MaskedView> views;  ///< One or more.
};

/// Rows from `from` on, before `to`.
struct RowRange {
  std::uint64_t from = 0, to = 0;
};

/// Rows by number.
struct Rows {
  std::vector<RowRange> ranges;  ///< One or more; may overlap.
};

// What changes the selection made so far. The op of such an operation is `add`; no other has a meaning.

/// Rows within `distance` of a selected one are selected, too: by means.
struct Expand {
  double distance = 0;  ///< Above 0.
};

/// Selected rows within `distance` of one that is not are dropped: by means.
struct Shrink {
  double distance = 0;  ///< Above 0.
};

/// All but the n largest connected pieces are dropped: see largest_pieces().
struct Largest {
  std::uint64_t n = 1;  ///< 1 or more.
};

/// What was selected is not, and the other way round.
struct Invert {};

using Action = std::variant<Sphere, Box, Plane, Polygon, Stroke, Grow, Masks, Rows, Expand, Shrink, Largest, Invert>;

/// The name of an action in the contract, such as "sphere".
[[nodiscard]] const char* name_of(const Action& action);

/// One step of a selection.
struct Operation {
  Op op = Op::add;
  Action action;
};

/// Carried out in order, beginning with no row. An empty list selects nothing.
using Selection = std::vector<Operation>;

// How much a selection may ask for, in all its operations: what a patient person does with a mouse, with room, and
// what a million Gaussians answer within seconds.
constexpr std::size_t max_operations = 256;
constexpr std::size_t max_points = 4'096;     ///< Of polygons, strokes and growing.
constexpr std::size_t max_views = 64;         ///< That are rendered: of masks, and of what is `visible`.
constexpr std::size_t max_pixels = 1u << 24;  ///< Of one such view.
constexpr std::size_t max_searches = 32;      ///< Of neighbours: grow, masks, expand, shrink, largest.
constexpr std::size_t max_ranges = 100'000;   ///< Of rows.
constexpr int max_wider = 64;                 ///< Borders farther out or in: a thing has a dozen.
constexpr double max_pixel_position = 1e6;    ///< Pixels: a point farther from a picture is a mistake.
constexpr double max_world_number = 1e38;     ///< World units: no mean, a float, lies farther.

/// Can the selection be carried out on a scene of so many rows?
///   errors  invalid_argument, too_large (a limit above) or unprocessable (a row that the scene does not have); `where`
///           is the address: "selection[2].polygon.points[1]", "selection[0].masks[3].camera.fx"
[[nodiscard]] Result<void> validate(const Selection& selection, std::size_t rows);

/// "selection[2]"
[[nodiscard]] std::string address(std::size_t operation);

}  // namespace engine::select
