#include "proto/render_request.h"

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>
#include <system_error>

#include "proto/camera_fields.h"
#include "proto/json_document.h"

namespace proto {
namespace {

using engine::propagate;
using nlohmann::json;

constexpr std::array what_names{Name{PictureContent::color, "color"}, Name{PictureContent::depth, "depth"},
                                Name{PictureContent::alpha, "alpha"}, Name{PictureContent::mask, "mask"}};
constexpr std::array format_names{Name{PictureFormat::jpeg, "jpeg"}, Name{PictureFormat::png, "png"},
                                  Name{PictureFormat::exr, "exr"}};

Point read_colour(const JsonField& field) {
  Point colour{};
  const auto channels = field.elements(3, 3, "numbers");
  for (std::size_t i = 0; i < channels.size(); ++i) colour[i] = channels[i].number(0, 1);
  return colour;
}

/// What both forms say in the same words.
void read_options(const Members& members, RenderRequest& request) {
  if (const auto f = members.optional("what")) request.content = f->one_of(what_names);
  if (const auto f = members.optional("format")) request.format = f->one_of(format_names);
  if (const auto f = members.optional("max_side")) request.max_side = f->whole(1, max_camera_side);
  if (const auto f = members.optional("background")) request.background = read_colour(*f);
  if (const auto f = members.optional("sh_degree")) request.sh_degree = f->whole(0, 3);
  if (const auto f = members.optional("quality")) request.quality = f->whole(1, 100);
  if (const auto f = members.optional("selection")) {
    request.selection = f->text();
    if (request.content != PictureContent::color) f->refuse("only colours are tinted: leave this or `what` out");
  }
}

RenderRequest read_request(const JsonField& field) {
  const Members members(
      field, {"camera", "view", "what", "format", "max_side", "background", "sh_degree", "quality", "selection"});
  RenderRequest request;
  request.viewpoint = read_viewpoint(field, members);
  read_options(members, request);
  return request;
}

RenderRequest read_query(const JsonField& field) {
  const Members members(field, {"view", "eye", "target", "up", "fov", "width", "height", "what", "format", "max_side",
                                "background", "sh_degree", "quality", "selection"});
  RenderRequest request;
  if (const auto view = members.optional("view")) {
    request.viewpoint = view->text();
    for (const char* name : {"eye", "target", "up", "fov", "width", "height"})
      if (const auto f = members.optional(name)) f->refuse("a view has its own camera: leave this or view out");
  } else {
    LookAtCamera camera;
    if (const auto f = members.required("eye")) camera.eye = f->point();
    if (const auto f = members.required("target")) camera.target = f->point();
    if (const auto f = members.optional("up")) camera.up = read_direction(*f);
    if (const auto f = members.optional("fov")) camera.fov_y_deg = read_fov(*f);
    if (const auto f = members.required("width")) camera.width = f->whole(1, max_camera_side);
    if (const auto f = members.required("height")) camera.height = f->whole(1, max_camera_side);
    request.viewpoint = camera;
  }
  read_options(members, request);
  return request;
}

/// A number where the text is one, else the text, which whoever expects a number will refuse.
json scalar(std::string_view text) {
  const char* const end = text.data() + text.size();
  std::int64_t whole = 0;
  if (const auto read = std::from_chars(text.data(), end, whole); read.ec == std::errc() && read.ptr == end)
    return whole < 0 ? json(whole) : json(std::uint64_t(whole));
  double number = 0;
  if (const auto read = std::from_chars(text.data(), end, number); read.ec == std::errc() && read.ptr == end)
    return number;
  return std::string(text);
}

json list(std::string_view text) {
  json values = json::array();
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t comma = std::min(text.find(',', begin), text.size());
    values.push_back(scalar(text.substr(begin, comma - begin)));
    begin = comma + 1;
  }
  return values;
}

json value_of(std::string_view name, const std::string& text) {
  if (name == "view" || name == "what" || name == "format" || name == "selection") return text;
  if (name == "eye" || name == "target" || name == "up" || name == "background") return list(text);
  return scalar(text);
}

Result<RenderRequest> decode(const json& document, RenderRequest (*read)(const JsonField&)) {
  std::optional<engine::Error> error;
  RenderRequest request = read(JsonField(document, "", error));
  if (error) return tl::make_unexpected(std::move(*error));
  return request;
}

}  // namespace

std::vector<std::string> render_queries() {
  return {"view", "eye",    "target",   "up",         "fov",       "width",   "height",
          "what", "format", "max_side", "background", "sh_degree", "quality", "selection"};
}

Result<RenderRequest> parse_render_request(std::string_view text, const JsonLimits& limits) {
  const auto document = parse_document(text, limits);
  if (!document) return propagate(document);
  return decode(*document, read_request);
}

Result<RenderRequest> parse_render_query(const std::function<std::optional<std::string>(std::string_view)>& query) {
  json document = json::object();
  for (const std::string& name : render_queries())
    if (const auto text = query(name)) document[name] = value_of(name, *text);
  return decode(document, read_query);
}

}  // namespace proto
