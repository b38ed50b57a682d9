#include "proto/selection_fields.h"

#include <array>
#include <type_traits>
#include <utility>

#include "proto/base64.h"
#include "proto/camera_fields.h"

namespace proto {
namespace {

using nlohmann::ordered_json;
using namespace selection;  // its words are those of this file

std::vector<Pixel> read_pixels(const JsonField& field, std::size_t least) {
  std::vector<Pixel> pixels;
  for (const JsonField& pixel : field.elements(least, max_points, "points"))
    pixels.push_back(pixel.numbers<2>(-max_pixel_position, max_pixel_position));
  return pixels;
}

std::vector<Point> read_points(const JsonField& field, std::size_t least) {
  std::vector<Point> points;
  for (const JsonField& point : field.elements(least, max_points, "points")) points.push_back(point.point());
  return points;
}

Action read_sphere(const JsonField& field) {
  const Members members(field, {"center", "radius"});
  Sphere sphere;
  if (const auto f = members.required("center")) sphere.center = f->point();
  if (const auto f = members.required("radius")) sphere.radius = f->length();
  return sphere;
}

Action read_box(const JsonField& field) {
  const Members members(field, {"center", "size", "rotation"});
  Box box;
  if (const auto f = members.required("center")) box.center = f->point();
  if (const auto f = members.required("size")) box.size = f->edges();
  if (const auto f = members.optional("rotation")) {
    box.rotation = f->numbers<4>(-max_coordinate, max_coordinate);
    if (box.rotation == std::array<double, 4>{}) f->refuse("expected a quaternion that is not zero");
  }
  return box;
}

Action read_plane(const JsonField& field) {
  const Members members(field, {"point", "normal"});
  Plane plane;
  if (const auto f = members.required("point")) plane.point = f->point();
  if (const auto f = members.required("normal")) plane.normal = read_direction(*f);
  return plane;
}

Action read_polygon(const JsonField& field) {
  const Members members(field, {"view", "camera", "points", "depth"});
  Polygon polygon;
  polygon.viewpoint = read_viewpoint(field, members);
  if (const auto f = members.required("points")) polygon.points = read_pixels(*f, 3);
  if (const auto f = members.optional("depth")) polygon.depth = f->one_of(engine::names<Depth>);
  return polygon;
}

Action read_stroke(const JsonField& field) {
  const Members members(field, {"view", "camera", "points", "radius", "depth"});
  Stroke stroke;
  stroke.viewpoint = read_viewpoint(field, members);
  if (const auto f = members.required("points")) stroke.points = read_pixels(*f, 1);
  if (const auto f = members.required("radius")) {
    stroke.radius = f->length();
    if (stroke.radius > max_pixel_position) f->refuse("expected a radius of at most 1e6 pixels");
  }
  if (const auto f = members.optional("depth")) stroke.depth = f->one_of(engine::names<Depth>);
  return stroke;
}

Action read_grow(const JsonField& field) {
  const Members members(field, {"inside", "outside", "reach", "whole", "wider"});
  Grow grow;
  if (const auto f = members.required("inside")) grow.inside = read_points(*f, 1);
  if (const auto f = members.optional("outside")) grow.outside = read_points(*f, 0);
  if (const auto f = members.optional("reach")) grow.reach = f->length();
  if (const auto f = members.optional("whole")) grow.whole = f->boolean();
  if (const auto f = members.optional("wider")) grow.wider = f->whole(-max_wider, max_wider);
  return grow;
}

std::string read_image(const JsonField& field) {
  const std::string text = field.text(max_image_bytes);
  auto bytes = from_base64(text);
  if (!bytes || bytes->empty()) {
    field.refuse("expected the bytes of a PNG file as base64, without \"data:\" before them and without line breaks");
    return {};
  }
  return *std::move(bytes);
}

Action read_masks(const JsonField& field) {
  Masks masks;
  for (const JsonField& mask : field.elements(1, max_masks, "masks")) {
    const Members members(mask, {"view", "camera", "image"});
    MaskedView& view = masks.views.emplace_back();
    view.viewpoint = read_viewpoint(mask, members);
    if (const auto f = members.required("image")) view.image = read_image(*f);
  }
  return masks;
}

Action read_rows(const JsonField& field) {
  Rows rows;
  for (const JsonField& range : field.elements(1, max_ranges, "ranges of rows")) {
    const auto ends = range.elements(2, 2, "rows, [from, to]");
    if (ends.size() == 2) rows.ranges.push_back({ends[0].unsigned_number(), ends[1].unsigned_number()});
  }
  return rows;
}

Action read_expand(const JsonField& field) { return Expand{field.length()}; }
Action read_shrink(const JsonField& field) { return Shrink{field.length()}; }

Action read_largest(const JsonField& field) {
  const std::uint64_t n = field.unsigned_number();
  if (n == 0) field.refuse("expected a number of pieces, 1 or more");
  return Largest{n};
}

Action read_invert(const JsonField& field) {
  if (!field.boolean()) field.refuse("expected true: leave the operation out instead");
  return Invert{};
}

/// How the wire calls an action, and how it is read.
struct ActionForm {
  std::string_view name;
  Action (*read)(const JsonField&);
};
/// In the order of Action.
constexpr std::array forms{
    ActionForm{"sphere", read_sphere},   ActionForm{"box", read_box},         ActionForm{"plane", read_plane},
    ActionForm{"polygon", read_polygon}, ActionForm{"stroke", read_stroke},   ActionForm{"grow", read_grow},
    ActionForm{"masks", read_masks},     ActionForm{"rows", read_rows},       ActionForm{"expand", read_expand},
    ActionForm{"shrink", read_shrink},   ActionForm{"largest", read_largest}, ActionForm{"invert", read_invert}};
static_assert(forms.size() == std::variant_size_v<Action>);

Operation read_operation(const JsonField& field) {
  std::array<std::string_view, forms.size() + 1> known{"op"};
  for (std::size_t i = 0; i < forms.size(); ++i) known[i + 1] = forms[i].name;
  const Members members(field, known);
  Operation operation;
  if (const auto f = members.optional("op")) operation.op = f->one_of(engine::names<Op>);
  int actions = 0;
  for (const ActionForm& form : forms)
    if (const auto f = members.optional(form.name)) {
      ++actions;
      operation.action = form.read(*f);
    }
  if (actions != 1) {
    std::string names;
    for (const ActionForm& form : forms) names += (names.empty() ? "" : ", ") + std::string(form.name);
    field.refuse("expected exactly one of " + names);
  }
  return operation;
}

/// An object that names its camera or its view.
ordered_json seen_through(const Viewpoint& viewpoint) {
  if (const auto* camera = std::get_if<Camera>(&viewpoint)) return {{"camera", encode(*camera)}};
  return {{"view", std::get<std::string>(viewpoint)}};
}

ordered_json encode(const Sphere& sphere) { return {{"center", sphere.center}, {"radius", sphere.radius}}; }
ordered_json encode(const Box& box) { return {{"center", box.center}, {"size", box.size}, {"rotation", box.rotation}}; }
ordered_json encode(const Plane& plane) { return {{"point", plane.point}, {"normal", plane.normal}}; }
ordered_json encode(const Polygon& polygon) {
  ordered_json out = seen_through(polygon.viewpoint);
  out["points"] = polygon.points;
  out["depth"] = name_of(polygon.depth);
  return out;
}
ordered_json encode(const Stroke& stroke) {
  ordered_json out = seen_through(stroke.viewpoint);
  out["points"] = stroke.points;
  out["radius"] = stroke.radius;
  out["depth"] = name_of(stroke.depth);
  return out;
}
ordered_json encode(const Grow& grow) {
  ordered_json out{{"inside", grow.inside}};
  if (!grow.outside.empty()) out["outside"] = grow.outside;
  if (grow.reach) out["reach"] = *grow.reach;
  if (grow.whole) out["whole"] = true;
  if (grow.wider != 0) out["wider"] = grow.wider;
  return out;
}
ordered_json encode(const Masks& masks) {
  ordered_json out = ordered_json::array();
  for (const MaskedView& view : masks.views) {
    out.push_back(seen_through(view.viewpoint));
    out.back()["image"] = to_base64(view.image);
  }
  return out;
}
ordered_json encode(const Rows& rows) {
  ordered_json out = ordered_json::array();
  for (const RowRange& range : rows.ranges) out.push_back({range.from, range.to});
  return out;
}
ordered_json encode(const Expand& expand) { return expand.distance; }
ordered_json encode(const Shrink& shrink) { return shrink.distance; }
ordered_json encode(const Largest& largest) { return largest.n; }
ordered_json encode(const Invert&) { return true; }

}  // namespace

std::string_view selection::name_of(const Action& action) { return forms[action.index()].name; }

Selection read_selection(const JsonField& field) {
  Selection operations;
  for (const JsonField& operation : field.elements(0, max_operations, "operations"))
    operations.push_back(read_operation(operation));
  return operations;
}

ordered_json encode(const Selection& operations) {
  ordered_json out = ordered_json::array();
  for (const Operation& operation : operations) {
    ordered_json& one = out.emplace_back(ordered_json::object());
    if (operation.op != Op::add) one["op"] = name_of(operation.op);
    one[std::string(name_of(operation.action))] =
        std::visit([](const auto& action) { return encode(action); }, operation.action);
  }
  return out;
}

}  // namespace proto
