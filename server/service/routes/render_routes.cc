#include "server/service/routes/render_routes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "engine/scene/overlay.h"
#include "proto/pick.h"
#include "proto/render_request.h"
#include "proto/selection.h"
#include "server/edits/convert_selection.h"
#include "server/edits/points.h"

namespace server::service::routes {
namespace {

using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using engine::Result;
using engine::io::ImageFormat;
using http::Call;
using http::Reply;
using proto::PictureFormat;
using scenes::LoadedVersion;

using Dependencies = RenderRouteDependencies;

const char* media_type(PictureFormat format) {
  switch (format) {
    case PictureFormat::jpeg:
      return "image/jpeg";
    case PictureFormat::png:
      return "image/png";
    case PictureFormat::exr:
      break;
  }
  return "image/x-exr";
}

ImageFormat to_engine(PictureFormat format) {
  return format == PictureFormat::jpeg  ? ImageFormat::jpeg
         : format == PictureFormat::png ? ImageFormat::png
                                        : ImageFormat::exr;
}

PictureContent to_engine(proto::PictureContent content) {
  switch (content) {
    case proto::PictureContent::depth:
      return PictureContent::depth;
    case proto::PictureContent::alpha:
      return PictureContent::alpha;
    case proto::PictureContent::mask:
      return PictureContent::mask;
    case proto::PictureContent::color:
      break;
  }
  return PictureContent::color;
}

/// The format that the client accepts and that suits best: JPEG for colours; PNG for the rest, whose edges it keeps.
std::optional<PictureFormat> accepted_format(const Call& call, proto::PictureContent content) {
  std::array<PictureFormat, 3> formats{PictureFormat::jpeg, PictureFormat::png, PictureFormat::exr};
  if (content != proto::PictureContent::color) std::swap(formats[0], formats[1]);
  for (const PictureFormat format : formats)
    if (call.accepts(media_type(format))) return format;
  return std::nullopt;
}

std::string server_timing(const Picture& picture) {
  std::array<char, 80> text{};
  std::snprintf(text.data(), text.size(), "render;dur=%.1f, encode;dur=%.1f", picture.render_ms, picture.encode_ms);
  return text.data();
}

/// where  address of the camera's fields: "camera.", or "" in a query
Result<Reply> render(const Call& call, const Dependencies& dependencies, const proto::RenderRequest& request,
                     const std::string& where) {
  const std::string& id = call.path("id");
  const auto format = request.format ? request.format : accepted_format(call, request.content);
  if (!format)
    return Reply::refusal({406, "not_acceptable",
                           "pictures are image/jpeg, image/png or image/x-exr; Accept takes none of them", "Accept"},
                          call.request_id());
  auto camera = dependencies.views.resolve(id, request.viewpoint, where, [&call] { return call.gone(); });
  if (!camera) return propagate(camera);
  const auto version = dependencies.store.load(id, call.path("v"));
  if (!version) return propagate(version);
  PictureOrder order;
  order.camera = request.max_side ? engine::scene::fit_within(*camera, *request.max_side) : *camera;
  order.content = to_engine(request.content);
  order.format = to_engine(*format);
  for (int i = 0; i < 3; ++i) order.background[i] = float(request.background[std::size_t(i)]);
  order.sh_degree = request.sh_degree;
  order.quality = request.quality;
  if (request.selection) {
    auto selection = dependencies.selections.find(*version, *request.selection);
    if (!selection) return propagate(selection);
    order.selection = *std::move(selection);
  }
  Reply reply;
  reply.media_type = media_type(*format);
  reply.etag = dependencies.renders.etag(*version, order);
  if (!request.format) reply.headers.emplace_back("Vary", "Accept");
  if (call.has(reply.etag)) {
    reply.status = 304;
    return reply;
  }
  auto picture = dependencies.renders.render(*version, order);
  if (!picture) return propagate(picture);
  reply.headers.emplace_back("Server-Timing", server_timing(*picture));
  reply.body = std::move(picture->bytes);
  return reply;
}

Result<Reply> get_render(const Call& call, const Dependencies& dependencies) {
  const auto request = proto::parse_render_query([&](std::string_view name) { return call.query(name); });
  if (!request) return propagate(request);
  return render(call, dependencies, *request, "");
}

Result<Reply> post_render(const Call& call, const Dependencies& dependencies) {
  const auto request = proto::parse_render_request(call.body());
  if (!request) return propagate(request);
  return render(call, dependencies, *request, "camera.");
}

/// How many Gaussians a sphere holds.
Result<std::size_t> count(const Dependencies& dependencies, const LoadedVersion& version, engine::DVec3 point,
                          double radius) {
  std::size_t within = 0;
  auto done =
      dependencies.renders.run_in_turn([&] { within = engine::scene::count_within(version.cloud, point, radius); });
  if (!done) return propagate(done);
  return within;
}

Result<proto::PickResult> pick_point(const Dependencies& dependencies, const LoadedVersion& version,
                                     const proto::PickRequest& request) {
  const auto within = count(dependencies, version, edits::to_vec(*request.point), *request.radius);
  if (!within) return propagate(within);
  proto::PickResult result;
  result.hit = true;
  result.point = request.point;
  result.gaussians_in_radius = *within;
  return result;
}

Result<void> check_pixel(const proto::PickRequest& request, const engine::scene::Camera& camera) {
  const auto outside = [&](const char* where, int size) {
    return fail(ErrorCode::invalid_argument,
                "expected a position within the picture, 0 to " + std::to_string(size) + " pixels", where);
  };
  if (request.x > camera.width) return outside("x", camera.width);
  if (request.y > camera.height) return outside("y", camera.height);
  return {};
}

/// Whether a request may name the point, as a handle's source or a sphere's centre.
bool is_nameable(engine::DVec3 point) {
  return std::max({std::abs(point.x), std::abs(point.y), std::abs(point.z)}) <= proto::max_coordinate;
}

Result<proto::PickResult> pick_pixel(const std::string& id, const Dependencies& dependencies,
                                     const LoadedVersion& version, const proto::PickRequest& request,
                                     const SceneViews::Gone& gone) {
  const auto camera = dependencies.views.resolve(id, *request.viewpoint, "camera.", gone);
  if (!camera) return propagate(camera);
  if (auto inside = check_pixel(request, *camera); !inside) return propagate(inside);
  // The limit is one of pictures, and nobody asked for one: a smaller camera sees the same point.
  const auto scaled = engine::scene::fit_within(*camera, dependencies.renders.options().max_side);
  const auto hit = dependencies.renders.pick(
      version, scaled, {request.x * scaled.width / camera->width, request.y * scaled.height / camera->height});
  if (!hit) return propagate(hit);
  proto::PickResult result;
  if (!*hit || !is_nameable((*hit)->point)) return result;
  const engine::render::PixelHit& found = **hit;
  result.hit = true;
  result.point = edits::to_point(found.point);
  result.depth = found.depth;
  result.normal = edits::to_point(found.normal);
  result.gaussian = found.row;
  if (request.radius) {
    const auto within = count(dependencies, version, found.point, *request.radius);
    if (!within) return propagate(within);
    result.gaussians_in_radius = *within;
  }
  return result;
}

Result<Reply> post_pick(const Call& call, const Dependencies& dependencies) {
  const auto request = proto::parse_pick_request(call.body());
  if (!request) return propagate(request);
  const std::string& id = call.path("id");
  const auto version = dependencies.store.load(id, call.path("v"));
  if (!version) return propagate(version);
  const auto result = request->point
                          ? pick_point(dependencies, *version, *request)
                          : pick_pixel(id, dependencies, *version, *request, [&call] { return call.gone(); });
  if (!result) return propagate(result);
  return Reply::json(proto::to_json(*result));
}

proto::SelectionSummary summary_of(const edits::MadeSelection& made) {
  const auto& selected = made.selected;
  proto::SelectionSummary summary;
  summary.id = made.id;
  summary.count = selected.count;
  summary.low = edits::to_point(engine::DVec3(selected.bounds.low));
  summary.high = edits::to_point(engine::DVec3(selected.bounds.high));
  summary.centre = edits::to_point(selected.centre);
  summary.undecided = selected.undecided;
  if (const auto& border = selected.border) summary.border = {border->wider, border->more, border->less};
  summary.warnings = edits::warnings_of(selected);
  return summary;
}

Result<Reply> post_select(const Call& call, const Dependencies& dependencies) {
  const auto asked = proto::parse_selection(call.body());
  if (!asked) return propagate(asked);
  const std::string& id = call.path("id");
  const auto version = dependencies.store.load(id, call.path("v"));
  if (!version) return propagate(version);
  const auto resolved = dependencies.selections.resolve(id, *asked);
  if (!resolved) return propagate(resolved);
  Result<std::shared_ptr<const edits::MadeSelection>> made;
  auto done = dependencies.renders.run_in_turn([&] { made = dependencies.selections.make(*version, *resolved); });
  if (!done) return propagate(done);
  if (!made) return propagate(made);
  return Reply::json(proto::to_json(summary_of(**made)));
}

}  // namespace

void add_render_routes(http::Router& router, const RenderRouteDependencies& dependencies) {
  const std::string version = "/v1/scenes/{id}/versions/{v}";
  router.add({.method = "GET",
              .path = version + "/render",
              .handler = [dependencies](const Call& call) { return get_render(call, dependencies); },
              .queries = proto::render_queries(),
              .access = http::Access::read});
  router.add({.method = "POST",
              .path = version + "/render",
              .handler = [dependencies](const Call& call) { return post_render(call, dependencies); },
              .body = http::Body::json,
              .queries = {},
              .access = http::Access::read});
  router.add({.method = "POST",
              .path = version + "/pick",
              .handler = [dependencies](const Call& call) { return post_pick(call, dependencies); },
              .body = http::Body::json,
              .queries = {},
              .access = http::Access::read});
  router.add({.method = "POST",
              .path = version + "/select",
              .handler = [dependencies](const Call& call) { return post_select(call, dependencies); },
              .body = http::Body::json,
              .queries = {},
              .access = http::Access::read});
}

}  // namespace server::service::routes
