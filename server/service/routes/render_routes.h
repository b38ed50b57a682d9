// /v1/scenes/{id}/versions/{v}/render, .../pick and .../select.
#pragma once

#include "server/edits/selections.h"
#include "server/http/router.h"
#include "server/scenes/scene_store.h"
#include "server/service/render_service.h"
#include "server/service/scene_views.h"

namespace server::service::routes {

/// What these routes work with; all of it outlives the router.
struct RenderRouteDependencies {
  scenes::SceneStore& store;
  SceneViews& views;
  RenderService& renders;
  edits::Selections& selections;
};

/// Adds these routes.
void add_render_routes(http::Router& router, const RenderRouteDependencies& dependencies);

}  // namespace server::service::routes
