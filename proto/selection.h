// Which Gaussians are meant, as it travels: a list of operations, carried out in order on a version of a scene. Each is
// an object with its action as the one member beside `op`:
//   {"op": "subtract", "sphere": {"center": [0, 0, 1], "radius": 0.2}}
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "engine/core/names.h"
#include "proto/camera.h"
#include "proto/wire.h"

namespace proto::selection {

using engine::name_of;  // of an enumerator, such as "subtract"

// Limits of what is read; those that hold over all operations are the engine's to check.
constexpr std::size_t max_operations = 256;
constexpr std::size_t max_points = 4'096;  ///< Of one operation.
constexpr std::size_t max_masks = 64;      ///< Of one operation.
constexpr int max_wider = 64;              ///< Borders farther out or in.
constexpr std::size_t max_ranges = 100'000;
constexpr std::size_t max_image_bytes = std::size_t{16} << 20;  ///< Of a mask, as base64.
constexpr double max_pixel_position = 1e6;

/// What an operation does with the Gaussians it names.
enum class Op : std::uint8_t { add, subtract, intersect };
constexpr auto names_of(Op) {
  return std::array{engine::Name{Op::add, "add"}, engine::Name{Op::subtract, "subtract"},
                    engine::Name{Op::intersect, "intersect"}};
}

/// Which of those behind a part of a picture are meant.
enum class Depth : std::uint8_t { visible, through };
constexpr auto names_of(Depth) {
  return std::array{engine::Name{Depth::visible, "visible"}, engine::Name{Depth::through, "through"}};
}

using Pixel = std::array<double, 2>;  ///< From the upper left corner of the picture; the first centre is at 0.5, 0.5.

// What names Gaussians; engine/select/operation.h says which.

struct Sphere {
  Point center{};
  double radius = 0;  ///< World units, above 0.
  bool operator==(const Sphere&) const = default;
};

struct Box {
  Point center{}, size{};                      ///< World units; full edge lengths, above 0.
  std::array<double, 4> rotation{1, 0, 0, 0};  ///< (w, x, y, z), world from box.
  bool operator==(const Box&) const = default;
};

struct Plane {
  Point point{}, normal{};  ///< The side that the normal points to is meant.
  bool operator==(const Plane&) const = default;
};

struct Polygon {
  Viewpoint viewpoint;
  std::vector<Pixel> points;  ///< 3 or more.
  Depth depth = Depth::visible;
  bool operator==(const Polygon&) const = default;
};

struct Stroke {
  Viewpoint viewpoint;
  std::vector<Pixel> points;  ///< 1 or more.
  double radius = 0;          ///< Pixels, above 0.
  Depth depth = Depth::visible;
  bool operator==(const Stroke&) const = default;
};

struct Grow {
  std::vector<Point> inside, outside;  ///< 1 or more on the thing; on what is not meant.
  std::optional<double> reach;         ///< World units, above 0, from inside[0].
  bool whole = false;                  ///< All of the thing, where a part of it ends nearly as sharply.
  int wider = 0;                       ///< Borders farther out, -64 to 64; below 0: farther in.
  bool operator==(const Grow&) const = default;
};

struct MaskedView {
  Viewpoint viewpoint;
  std::string image;  ///< Bytes of a picture file of the camera's size; base64 on the wire. What is at least half of
                      ///< white is meant.
  bool operator==(const MaskedView&) const = default;
};

struct Masks {
  std::vector<MaskedView> views;  ///< 1 or more.
  bool operator==(const Masks&) const = default;
};

struct RowRange {
  std::uint64_t from = 0, to = 0;  ///< `to` is exclusive.
  bool operator==(const RowRange&) const = default;
};

struct Rows {
  std::vector<RowRange> ranges;  ///< 1 or more.
  bool operator==(const Rows&) const = default;
};

// What changes the selection made so far.

struct Expand {
  double distance = 0;  ///< World units, above 0.
  bool operator==(const Expand&) const = default;
};

struct Shrink {
  double distance = 0;  ///< World units, above 0.
  bool operator==(const Shrink&) const = default;
};

struct Largest {
  std::uint64_t n = 1;  ///< Pieces, 1 or more.
  bool operator==(const Largest&) const = default;
};

struct Invert {  ///< Always `true` on the wire.
  bool operator==(const Invert&) const = default;
};

using Action = std::variant<Sphere, Box, Plane, Polygon, Stroke, Grow, Masks, Rows, Expand, Shrink, Largest, Invert>;

/// What the wire calls an action: "sphere".
[[nodiscard]] std::string_view name_of(const Action& action);

struct Operation {
  Op op = Op::add;
  Action action;
  bool operator==(const Operation&) const = default;
};

}  // namespace proto::selection

namespace proto {

using Selection = std::vector<selection::Operation>;

/// Reads {"selection": [...]}. Strict, as parse_edit_request(), with its errors. `where` is such as
/// "selection[2].grow.inside[1][0]".
[[nodiscard]] Result<Selection> parse_selection(std::string_view text, const JsonLimits& limits = {});

/// The selection as JSON that parse_selection() reads back.
[[nodiscard]] std::string to_json(const Selection& selection);

/// Where a whole ends, among the natural borders around its click.
struct SelectionBorder {
  int wider = 0;      ///< Grow::wider, or nearer to 0 where there are fewer borders on that side.
  bool more = false;  ///< One may lie farther out.
  bool less = false;  ///< One lies farther in.
};

/// What has been selected.
struct SelectionSummary {
  std::string id;                         ///< By which a render shows it for a while; the same for the same selection.
  std::size_t count = 0;                  ///< Gaussians.
  Point low{}, high{};                    ///< Box of their means, world units; all 0 without any.
  Point centre{};                         ///< Mean of their means, world units; 0 without any.
  std::size_t undecided = 0;              ///< Gaussians that masks leave nearly even.
  std::optional<SelectionBorder> border;  ///< Of the last operation that grows a whole.
  std::vector<std::string> warnings;
};

[[nodiscard]] std::string to_json(const SelectionSummary& summary);

}  // namespace proto
