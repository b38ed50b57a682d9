// All routes of the service: what proto/openapi.yaml describes.
#pragma once

#include "proto/service_info.h"
#include "server/edits/edit_service.h"
#include "server/edits/selections.h"
#include "server/http/access_guard.h"
#include "server/http/metrics.h"
#include "server/http/router.h"
#include "server/scenes/scene_store.h"
#include "server/service/render_service.h"
#include "server/service/routes/edit_routes.h"
#include "server/service/routes/system_routes.h"
#include "server/service/scene_views.h"

namespace server::service::routes {

/// What the routes work with. All of it outlives the router.
struct RouteDependencies {
  scenes::SceneStore& scenes;
  edits::EditService& edits;
  edits::Selections& selections;
  EditLimits edit_limits;
  RenderService& renders;
  SceneViews& views;
  http::AccessGuard& guard;
  http::Metrics& metrics;
  proto::ServiceInfo info;
  /// What keeps the service from working, if anything does; empty: what keeps edits from it.
  Trouble trouble = {};
};

/// A router with every path of the contract, and the files of the page.
[[nodiscard]] http::Router all_routes(const RouteDependencies& dependencies);

/// A router of a process that carries edits out and answers nobody but those who look after it.
///   metrics  outlives the router
[[nodiscard]] http::Router worker_routes(const http::Metrics& metrics, const Trouble& trouble);

}  // namespace server::service::routes
