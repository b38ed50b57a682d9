// What the service says about itself, and how a page signs in: /healthz, /readyz, /metrics, /openapi.yaml, /v1/info,
// /v1/session, and the page's own files.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "engine/core/result.h"
#include "proto/service_info.h"
#include "server/http/access_guard.h"
#include "server/http/metrics.h"
#include "server/http/router.h"
#include "server/service/embedded_files.h"

namespace server::service::routes {

/// What these routes work with.
struct SystemRouteDependencies {
  http::AccessGuard& guard;  ///< Outlives the router, as the metrics do.
  const http::Metrics& metrics;
  proto::ServiceInfo info;
  std::function<std::optional<engine::Error>()> trouble;  ///< What keeps the service from working, if anything does.
  std::vector<EmbeddedFile> page;                         ///< "index.html" is also "/".
  std::string_view contract;                              ///< openapi.yaml
};

/// Adds these routes.
void add_system_routes(http::Router& router, const SystemRouteDependencies& dependencies);

}  // namespace server::service::routes
