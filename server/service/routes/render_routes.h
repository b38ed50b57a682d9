// /v1/scenes/{id}/versions/{v}/render and .../pick.
#pragma once

#include "server/http/router.h"
#include "server/scenes/scene_store.h"
#include "server/service/render_service.h"
#include "server/service/scene_views.h"

namespace server::service::routes {

/// Adds these routes. All of the rest outlives the router.
void add_render_routes(http::Router& router, scenes::SceneStore& store, SceneViews& views, RenderService& renders);

}  // namespace server::service::routes
