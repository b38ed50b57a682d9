#include "engine/edit/preview.h"

#include <utility>

#include "engine/edit/drag.h"
#include "engine/edit/handles.h"
#include "engine/edit/messages.h"
#include "engine/edit/working_scene.h"

namespace engine::edit {

Result<PreviewOutcome> preview(const scene::LayeredCloud& scene, const Request& request) {
  if (const auto valid = validate(request); !valid) return propagate(valid);
  PreviewOutcome outcome;
  auto assignment = assign(scene::means(scene), request);
  if (!assignment) return propagate(assignment);
  outcome.counts = std::move(assignment->count);
  outcome.intervals = resolved_intervals(request);

  // A scene of P_h alone: no step of a drag looks at any other row, and the order of rows stays.
  std::vector<std::uint32_t> rows;
  deform::HandleColumn handle;
  for (std::size_t i = 0; i < assignment->handle.size(); ++i) {
    if (assignment->handle[i] == 0) continue;
    rows.push_back(std::uint32_t(i));
    handle.push_back(assignment->handle[i]);
  }
  const scene::GaussianCloud dragged = scene::gather(scene, rows);
  WorkingScene working = begin(dragged, request, handle);
  DragResult drag = drag_through(working, request, outcome.intervals, request.params.rotate_sh);
  Published published = publish(working, dragged, request.mode);

  outcome.overlay = std::move(published.overlay);
  for (auto* list : {&outcome.overlay.removed, &outcome.overlay.changed})
    for (std::uint32_t& row : *list) row = rows[row];
  if (scene.size() == outcome.overlay.removed.size() && outcome.overlay.added() == 0)
    return tl::make_unexpected(leaves_nothing());
  for (const DVec3& position : drag.positions) outcome.positions.push_back(position + working.origin);
  outcome.changeable = published.changeable;
  if (drag.copies.empty()) outcome.warnings.push_back(nothing_moves());
  for (std::string& warning : drag.warnings) outcome.warnings.push_back(std::move(warning));
  if (published.faint > 0) outcome.warnings.push_back(faint_left_out(published.faint));
  return outcome;
}

}  // namespace engine::edit
