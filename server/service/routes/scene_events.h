// GET /v1/scenes/{id}/events: what happens to a scene, for those who look at it together.
#pragma once

#include <chrono>

#include "server/edits/edit_service.h"
#include "server/http/router.h"
#include "server/scenes/scene_store.h"

namespace server::service::routes {

/// How the stream works.
struct SceneEventOptions {
  std::chrono::milliseconds look_every{250};      ///< Longest time from a change of the scene to its event; a choice.
  std::chrono::milliseconds sign_of_life{1'000};  ///< Between two events at most: who hears nothing for a few of them
                                                  ///< knows that the service, or the way to it, is gone.
};

/// Adds the route.
///   store, service  outlive the router
void add_scene_event_routes(http::Router& router, scenes::SceneStore& store, edits::EditService& service,
                            const SceneEventOptions& options = {});

}  // namespace server::service::routes
