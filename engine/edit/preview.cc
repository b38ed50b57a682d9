#include "engine/edit/preview.h"
#include "engine/core/rows.h"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <utility>

#include "engine/edit/drag.h"
#include "engine/edit/handles.h"
#include "engine/edit/messages.h"
#include "engine/edit/publish.h"

namespace engine::edit {
namespace {

/// How long work takes, or took when a memory found out what it now knows.
class Stopwatch {
 public:
  explicit Stopwatch(const Memory& memory) : memory_(memory), saved_(memory.saved_seconds()) {}
  [[nodiscard]] double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count() +
           (memory_.saved_seconds() - saved_);
  }

 private:
  const Memory& memory_;
  const double saved_;
  const std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

}  // namespace

Result<PreviewOutcome> preview(const scene::LayeredCloud& scene, const Request& request) {
  Memory memory;
  return preview(scene, request, memory);
}

Result<PreviewOutcome> preview(const scene::LayeredCloud& scene, const Request& request, Memory& memory) {
  if (const auto valid = validate(request); !valid) return propagate(valid);
  PreviewOutcome outcome;
  const Stopwatch assigning(memory);
  auto assignment = assign(scene, request, memory);
  if (!assignment) return propagate(assignment);
  outcome.counts = std::move(assignment->count);
  outcome.crumbs = assignment->crumbs;
  outcome.intervals = resolved_intervals(request);

  const Parts parts = parts_of(scene, assignment->handle, request, memory);
  outcome.parts = parts.attachments;
  outcome.assign_seconds = assigning.seconds();
  std::vector<std::uint32_t> rows = rows_in_use(assignment->handle, parts);
  const std::vector<std::uint32_t>& given_up = assignment->given_up;
  rows = united(rows, given_up);
  const scene::GaussianCloud dragged = scene::gather(scene, rows);
  const Stopwatch dragging(memory);
  DraggedAlone drag = drag_alone(std::move(rows), dragged, assignment->handle, request, parts, outcome.intervals,
                                 request.params.rotate_sh, memory);
  outcome.drag_seconds = dragging.seconds();
  const bool moves = !drag.working.rows_that_left().empty();
  if (moves)
    for (std::uint32_t k = 0; k < drag.rows.size(); ++k)
      if (std::ranges::binary_search(given_up, drag.rows[k])) drag.working.give_up(k);
  Published published = publish(drag.working, dragged, departure_of(request));

  outcome.overlay = std::move(published.overlay);
  for (auto* list : {&outcome.overlay.removed, &outcome.overlay.changed})
    for (std::uint32_t& row : *list) row = drag.rows[row];
  if (scene.size() == outcome.overlay.removed.size() && outcome.overlay.added() == 0)
    return tl::make_unexpected(leaves_nothing());
  outcome.positions = in_world(drag.working.frame(), drag.positions);
  outcome.changeable = published.changeable;
  if (!moves) outcome.warnings.push_back(nothing_moves());
  const auto more = std::back_inserter(outcome.warnings);
  std::ranges::move(warnings_of(parts), more);
  std::ranges::move(drag.warnings, more);
  std::ranges::move(handles_stop_short(request, parts, outcome.positions), more);
  if (published.faint > 0) outcome.warnings.push_back(faint_left_out(published.faint));
  return outcome;
}

}  // namespace engine::edit
