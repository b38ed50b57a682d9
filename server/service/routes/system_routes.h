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

/// What keeps the service from working, if anything does.
using Trouble = std::function<std::optional<engine::Error>()>;

/// What these routes work with.
struct SystemRouteDependencies {
  http::AccessGuard& guard;  ///< Outlives the router, as the metrics do.
  const http::Metrics& metrics;
  proto::ServiceInfo info;
  Trouble trouble;
  std::vector<EmbeddedFile> page;  ///< "index.html" is also "/".
  std::string_view contract;       ///< openapi.yaml
};

/// Adds /healthz, /readyz and /metrics.
///   metrics  outlives the router
void add_health_routes(http::Router& router, const http::Metrics& metrics, const Trouble& trouble);

/// Adds all of these routes.
void add_system_routes(http::Router& router, const SystemRouteDependencies& dependencies);

}  // namespace server::service::routes
