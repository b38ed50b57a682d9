#include "proto/pick.h"

#include <nlohmann/json.hpp>

#include "proto/camera_fields.h"
#include "proto/json_document.h"
#include "proto/json_text.h"

namespace proto {
namespace {

using engine::propagate;
using nlohmann::ordered_json;

constexpr double max_pixel = 1e6;  // absolute coordinate: far outside of any picture, and safe to compute with

PickRequest read_sphere(const JsonField& field) {
  const Members members(field, {"point", "radius"});
  PickRequest request;
  if (const auto f = members.required("point")) request.point = f->point();
  if (const auto f = members.required("radius")) request.radius = f->length();
  return request;
}

PickRequest read_pixel(const JsonField& field) {
  const Members members(field, {"camera", "view", "x", "y", "radius"});
  PickRequest request;
  request.viewpoint = read_viewpoint(field, members);
  if (const auto f = members.required("x")) request.x = f->number(0, max_pixel);
  if (const auto f = members.required("y")) request.y = f->number(0, max_pixel);
  if (const auto f = members.optional("radius")) request.radius = f->length();
  return request;
}

PickRequest read_request(const JsonField& field) {
  const Members members(field, {"camera", "view", "x", "y", "radius", "point"});
  return members.optional("point") ? read_sphere(field) : read_pixel(field);
}

template <class T>
ordered_json or_null(const std::optional<T>& value) {
  return value ? ordered_json(*value) : ordered_json(nullptr);
}

}  // namespace

Result<PickRequest> parse_pick_request(std::string_view text, const JsonLimits& limits) {
  const auto document = parse_document(text, limits);
  if (!document) return propagate(document);
  std::optional<engine::Error> error;
  PickRequest request = read_request(JsonField(*document, "", error));
  if (error) return tl::make_unexpected(std::move(*error));
  return request;
}

std::string to_json(const PickResult& result) {
  return pretty({{"hit", result.hit},
                 {"point", or_null(result.point)},
                 {"depth", or_null(result.depth)},
                 {"normal", or_null(result.normal)},
                 {"gaussian", or_null(result.gaussian)},
                 {"gaussians_in_radius", or_null(result.gaussians_in_radius)}});
}

}  // namespace proto
