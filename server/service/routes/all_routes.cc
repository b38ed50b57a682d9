#include "server/service/routes/all_routes.h"

#include "server/service/embedded_files.h"
#include "server/service/routes/render_routes.h"
#include "server/service/routes/scene_routes.h"
#include "server/service/routes/system_routes.h"

namespace server::service::routes {

http::Router all_routes(const ServiceParts& parts) {
  http::Router router;
  add_scene_routes(router, {parts.scenes, parts.renders, parts.views,
                            [&edits = parts.edits](const std::string& scene, const auto& change) {
                              return edits.while_idle(scene, change);
                            }});
  add_render_routes(router, parts.scenes, parts.views, parts.renders);
  add_edit_routes(router, parts.edits, {.limits = parts.edit_limits});
  add_system_routes(router, {parts.guard, parts.metrics, parts.info, [&edits = parts.edits] { return edits.trouble(); },
                             page_files(), contract_files().front().bytes});
  return router;
}

}  // namespace server::service::routes
