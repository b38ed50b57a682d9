#include "server/cli/suggested_drag.h"

#include "server/edits/points.h"

namespace server::cli {

using edits::to_point;

proto::EditRequest to_request(const engine::procedural::SuggestedDrag& drag) {
  proto::EditRequest request;
  request.mode = drag.mode == "extend" ? proto::Mode::extend : proto::Mode::move;
  for (const auto& handle : drag.handles) {
    proto::Handle& made = request.handles.emplace_back();
    made.source = to_point(handle.source);
    if (handle.target) made.target = to_point(*handle.target);
    made.radius = handle.radius;
  }
  return request;
}

}  // namespace server::cli
