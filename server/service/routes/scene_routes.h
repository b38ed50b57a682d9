// /v1/scenes: adding, listing, changing and removing scenes, their datasets, views and files.
#pragma once

#include <functional>
#include <string>

#include "engine/core/result.h"
#include "proto/scene.h"
#include "server/http/router.h"
#include "server/scenes/scene_store.h"
#include "server/service/render_service.h"
#include "server/service/scene_views.h"

namespace server::service::routes {

/// What these routes work with. All of it outlives the router.
struct SceneRouteDependencies {
  scenes::SceneStore& store;
  RenderService& renders;
  SceneViews& views;
  /// Makes a change to a scene that no edit of it may see half-way: EditService::while_idle(), whose errors it has.
  std::function<engine::Result<void>(const std::string& scene, const std::function<engine::Result<void>()>& change)>
      while_idle;
  /// EditService::remove_version()
  std::function<engine::Result<void>(const std::string& scene, const std::string& version)> remove_version;
};

/// A scene as its routes tell of it.
[[nodiscard]] proto::Scene told(const scenes::SceneInfo& scene);

/// Adds these routes.
void add_scene_routes(http::Router& router, const SceneRouteDependencies& dependencies);

}  // namespace server::service::routes
