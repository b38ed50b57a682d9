#include "server/service/routes/all_routes.h"

#include "server/service/embedded_files.h"
#include "server/service/routes/render_routes.h"
#include "server/service/routes/scene_events.h"
#include "server/service/routes/scene_routes.h"

namespace server::service::routes {

http::Router all_routes(const RouteDependencies& dependencies) {
  http::Router router;
  add_scene_routes(router, {dependencies.scenes, dependencies.renders, dependencies.views,
                            [&edits = dependencies.edits](const std::string& scene, const auto& change) {
                              return edits.while_idle(scene, change);
                            },
                            [&edits = dependencies.edits](const std::string& scene, const std::string& version) {
                              return edits.remove_version(scene, version);
                            }});
  add_render_routes(router, {dependencies.scenes, dependencies.views, dependencies.renders, dependencies.selections});
  add_edit_routes(router, dependencies.edits, {.limits = dependencies.edit_limits});
  add_scene_event_routes(router, dependencies.scenes, dependencies.edits);
  auto trouble = dependencies.trouble;
  if (!trouble) trouble = [&edits = dependencies.edits] { return edits.trouble(); };
  add_system_routes(router, {dependencies.guard, dependencies.metrics, dependencies.info, std::move(trouble),
                             page_files(), contract_files().front().bytes});
  return router;
}

http::Router worker_routes(const http::Metrics& metrics, const Trouble& trouble) {
  http::Router router;
  add_health_routes(router, metrics, trouble);
  router.say_of_others(
      "this process is a worker (--role worker): it carries edits out, and answers /healthz, /readyz and /metrics "
      "alone; ask a front");
  return router;
}

}  // namespace server::service::routes
