// /v1/scenes/{id}/versions/{v}/render and .../pick.
#pragma once

#include "server/http/router.h"
#include "server/render_service.h"
#include "server/scene_views.h"
#include "server/scenes/scene_store.h"

namespace server::routes {

/// All outlive the router.
void add_render_routes(http::Router& router, scenes::SceneStore& store, SceneViews& views, RenderService& renders);

}  // namespace server::routes
