// A service's scenes, views and renders behind its routes, and requests as handlers see them.
#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "server/http/negotiation.h"
#include "server/http/router.h"
#include "server/service/render_service.h"
#include "server/service/routes/render_routes.h"
#include "server/service/routes/scene_routes.h"
#include "server/service/scene_views.h"
#include "tests/server/scenes/store_support.h"

namespace server::service::routes {

using nlohmann::json;

/// A request after the service's door has let it in.
struct FakeCall : http::Call {
  std::map<std::string, std::string, std::less<>> in_path, in_query;
  std::string text, accept, known_etag, id = "request-1";
  bool json_body = true;
  std::string upload, upload_name;
  std::uint64_t declared = 0;  ///< Length of the body; 0: not said.
  http::TokenPtr by;

  const std::string& request_id() const override { return id; }
  const std::string& path(std::string_view name) const override { return in_path.find(name)->second; }
  std::optional<std::string> query(std::string_view name) const override {
    const auto found = in_query.find(name);
    return found == in_query.end() ? std::nullopt : std::optional(found->second);
  }
  std::string header(std::string_view name) const override {
    return name == "content-length" && declared > 0 ? std::to_string(declared) : std::string();
  }
  http::TokenPtr token() const override { return by; }
  bool has_header(std::string_view) const override { return false; }
  const std::string& body() const override { return text; }
  bool is_json() const override { return json_body; }
  engine::Result<http::UploadInfo> receive(const std::filesystem::path& file) const override {
    support::write_file(file, upload);
    return http::UploadInfo{upload_name, upload.size()};
  }
  bool has(const std::string& etag) const override { return etag == known_etag; }
  std::function<bool()> has_gone = {};
  bool gone() const override { return has_gone && has_gone(); }
  bool accepts(std::string_view media_type) const override { return http::accepts(accept, media_type); }
};

struct RouteFixture : scenes::StoreFixture {
  RenderService renders{{.threads = 2, .max_waiting = 8, .max_side = 256}};
  std::unique_ptr<SceneViews> views;
  std::unique_ptr<edits::Selections> selections;
  http::Router router;

  RouteFixture() { connect(); }
  void connect() {
    views = std::make_unique<SceneViews>(*store);
    selections = std::make_unique<edits::Selections>(*store);
    router = {};
    add_scene_routes(router, {*store, renders, *views, [](const std::string&, const auto& change) { return change(); },
                              [this](const std::string& id, const std::string& version) {
                                return store->remove_version(id, version);
                              }});
    add_render_routes(router, {*store, *views, renders, *selections});
  }

  engine::Result<http::Reply> call(const std::string& method, const std::string& path, const FakeCall& request) {
    for (const http::Route& route : router.routes())
      if (route.method == method && route.path == path) return route.handler(request);
    throw std::runtime_error("no route " + method + " " + path);
  }
  static FakeCall about(const std::string& scene, const std::string& version = "0") {
    FakeCall request;
    request.in_path = {{"id", scene}, {"v", version}};
    return request;
  }
  static FakeCall with_body(const std::string& scene, const std::string& text) {
    FakeCall request = about(scene);
    request.text = text;
    return request;
  }
  static std::string header_of(const http::Reply& reply, const std::string& name) {
    for (const auto& [key, text] : reply.headers)
      if (key == name) return text;
    return "";
  }
  /// A wall of opaque Gaussians at z = 0, 1 apart from its neighbours' middle, seen from z = -4.
  std::string add_wall() {
    GaussianWall wall;
    write(temp.path() / "wall.ply", wall.cloud());
    const auto added = store->add_upload(temp.path() / "wall.ply", "wall.ply", "");
    if (!added) throw std::runtime_error(added.error().message);
    return added->id;
  }

  struct GaussianWall {
    static scenes::GaussianCloud cloud() {
      scenes::GaussianCloud made;
      constexpr int side = 21;
      made.resize(side * side);
      for (int i = 0; i < side * side; ++i) {
        const auto row = std::size_t(i);
        made.mean.set(row, {0.1f * float(i % side - side / 2), 0.1f * float(i / side - side / 2), 0});
        made.log_scale.set(row, {-3, -3, -6});
        made.rotation.set(row, {1, 0, 0, 0});
        made.opacity_logit[row] = 8;
        for (int c = 0; c < 3; ++c) made.sh[row * 3 + std::size_t(c)] = float(c);
      }
      return made;
    }
  };
};

}  // namespace server::service::routes
