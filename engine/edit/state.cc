#include "engine/edit/state.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "engine/edit/handles.h"

namespace engine::edit {

bool is_of(const scene::GaussianCloud& input, const Request& request, const State& state) {
  const std::size_t handles = request.handles.size();
  Params resolved = request.params;
  resolved.intervals = resolved_intervals(request);
  bool fits = state.interval >= 1 && state.interval <= resolved.intervals && state.report.resolved == resolved &&
              state.positions.size() == handles && state.report.handles.size() == handles &&
              state.masks.size() == state.views.size() && state.scene.input_rows() == input.size() &&
              state.scene.cloud().sh_degree == input.sh_degree &&
              state.scene.cloud().extra_stride == input.extra_stride && state.scene.check();
  for (std::size_t v = 0; fits && v < state.views.size(); ++v)
    fits = scene::validate(state.views[v]).has_value() && state.masks[v].width == state.views[v].width &&
           state.masks[v].height == state.views[v].height;
  fits = fits && std::ranges::all_of(state.history, [&](const correct::HistoryPicture& picture) {
           return picture.origin == correct::Origin::edited && picture.view < state.views.size() &&
                  picture.interval >= 1 && picture.interval <= state.interval &&
                  picture.picture.width == state.views[picture.view].width &&
                  picture.picture.height == state.views[picture.view].height;
         });
  fits = fits && std::ranges::all_of(state.scene.handle(), [&](std::uint16_t owner) { return owner <= handles; });
  return fits && std::ranges::all_of(state.positions, [](const DVec3& p) {
           return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
         });
}

}  // namespace engine::edit
