// /v1/previews and /v1/edits.
#pragma once

#include <chrono>
#include <cstddef>

#include "engine/params/params.h"
#include "proto/camera.h"
#include "server/edits/edit_service.h"
#include "server/http/router.h"

namespace server::service::routes {

/// Most that a request may ask for.
struct EditLimits {
  std::size_t handles = proto::max_handles;
  int views = engine::params::max_views;
  int image_side = proto::max_camera_side;  ///< Pixels of the longer side of the pictures an edit works on.
};

/// How the routes work.
struct EditRouteOptions {
  EditLimits limits = {};
  std::chrono::milliseconds keep_alive{15'000};  ///< Longest silence of a stream of events; then a comment is sent.
};

/// Adds these routes.
///   service  outlives the router
void add_edit_routes(http::Router& router, edits::EditService& service, const EditRouteOptions& options = {});

}  // namespace server::service::routes
