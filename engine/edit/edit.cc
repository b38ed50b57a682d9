#include "engine/edit/edit.h"

#include <algorithm>

#include "engine/edit/drag.h"
#include "engine/edit/handles.h"
#include "engine/edit/look.h"
#include "engine/edit/paste.h"
#include "engine/edit/stages.h"
#include "engine/edit/working_scene.h"

namespace engine::edit {
namespace {

// How the time of an edit divides, for its progress: rough, but monotone.
constexpr double views_from = 0.02, intervals_from = 0.35, finish_from = 0.97;

Result<void> validate_cameras(std::span<const scene::Camera> cameras) {
  for (std::size_t i = 0; i < cameras.size(); ++i)
    if (const auto valid = scene::validate(cameras[i]); !valid)
      return fail(valid.error().code, valid.error().message,
                  "cameras[" + std::to_string(i) + "]." + valid.error().where);
  return {};
}

/// The input rows that gave rise to the given copies, ascending, each once.
std::vector<std::uint32_t> parents_of(const WorkingScene& working, std::span<const std::uint32_t> copies) {
  std::vector<std::uint32_t> parents;
  for (const std::uint32_t row : copies) parents.push_back(working.parent[row]);
  std::sort(parents.begin(), parents.end());
  parents.erase(std::unique(parents.begin(), parents.end()), parents.end());
  return parents;
}

void warn_of_unknown_names(std::span<const scene::Camera> cameras, const Params& params,
                           std::vector<std::string>& warnings) {
  for (const std::string& name : params.exclude_views)
    if (std::none_of(cameras.begin(), cameras.end(), [&](const scene::Camera& c) { return c.name == name; }))
      warnings.push_back("there is no view \"" + name + "\" to exclude");
}

/// 5. Views, by the covered area of the source and of the fully deformed target, which a dry run gives. Leaves the
/// working scene as it was.
Result<std::vector<scene::Camera>> choose_views(const scene::GaussianCloud& scene,
                                                std::span<const scene::Camera> cameras, const Request& request,
                                                const deform::HandleColumn& handle, WorkingScene& working,
                                                Stages& stages, Report& report) {
  const auto candidates = candidate_cameras(scene, cameras, request);
  warn_of_unknown_names(candidates, request.params, report.warnings);
  const auto advance_from = [&](double part) {
    return [&stages, part](double done) {
      return stages.advance(views_from + (intervals_from - views_from) * (part + done / 2));
    };
  };
  const auto copies = drag_through(working, request, report.resolved.intervals, /*rotate_sh=*/false);
  const auto target_areas = covered_areas(working, copies, candidates, advance_from(0));
  if (!target_areas) return propagate(target_areas);
  const auto sources = parents_of(working, copies);
  rewind(working, scene, handle);
  const auto source_areas = covered_areas(working, sources, candidates, advance_from(0.5));
  if (!source_areas) return propagate(source_areas);
  auto chosen = choose_views(candidates, *source_areas, *target_areas, request);
  if (copies.empty())
    report.warnings.push_back("nothing moves: every target is where its handle is");
  else if (chosen.empty())
    report.warnings.push_back("no view sees the edited part");
  return chosen;
}

}  // namespace

Result<Outcome> run(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras, const Request& request,
                    const Observer& observer) {
  if (const auto valid = validate(request); !valid) return propagate(valid);
  if (const auto valid = validate_cameras(cameras); !valid) return propagate(valid);
  Outcome outcome;
  Report& report = outcome.report;
  Stages stages(observer, report.times);

  // 1. Assign: P_h^i, and the start of the 3D mask M.
  if (const auto going = stages.enter("assign", 0, 0); !going) return propagate(going);
  const auto assignment = assign(scene, request);
  if (!assignment) return propagate(assignment);
  WorkingScene working = begin(scene, request, assignment->handle);

  // 2. Intervals.
  const int intervals = resolved_intervals(request);
  stages.set_intervals(intervals);
  report.resolved = request.params;
  report.resolved.intervals = intervals;
  report.input_gaussians = scene.size();
  for (const std::size_t count : assignment->count) report.handles.push_back({count, {}});

  if (const auto going = stages.enter("views", 0, views_from); !going) return propagate(going);
  auto views = choose_views(scene, cameras, request, assignment->handle, working, stages, report);
  if (!views) return propagate(views);
  outcome.views = std::move(*views);
  for (const scene::Camera& view : outcome.views) outcome.masks.emplace_back(view.width, view.height);

  std::vector<DVec3> positions = handle_sources(working, request);
  std::vector<std::uint32_t> shown;  // the rows of the last mask rendering
  for (int u = 1; u <= intervals; ++u) {
    // Within an interval: 0 to 0.45 what it looked like, 0.5 to 0.95 what it looks like.
    const auto fraction = [&](double part) {
      return intervals_from + (finish_from - intervals_from) * (u - 1 + part) / intervals;
    };
    const auto advance_between = [&](double from, double to) {
      return
          [&stages, &fraction, from, to](double done) { return stages.advance(fraction(from + (to - from) * done)); };
    };

    // 3. Deform from the relocated handles to p_t'(u).
    if (const auto going = stages.enter("deform", u, fraction(0)); !going) return propagate(going);
    const Step step = plan_step(working, request, positions, u, intervals);

    // 6. 2D masks: the moving Gaussians before the deformation ... (unless the last picture showed exactly that)
    if (step.moving != shown) {
      if (const auto going = stages.enter("mask", u, fraction(0)); !going) return propagate(going);
      const auto united = unite_masks(working, step.moving, outcome.views, outcome.masks, advance_between(0, 0.45));
      if (!united) return propagate(united);
    }

    // 4. Copy and paste.
    if (const auto going = stages.enter("deform", u, fraction(0.45)); !going) return propagate(going);
    shown = paste(working, step.deformation, step.rows, request.mode, request.params.rotate_sh);
    std::sort(shown.begin(), shown.end());

    // 6. ... and after it.
    if (const auto going = stages.enter("mask", u, fraction(0.5)); !going) return propagate(going);
    const auto united = unite_masks(working, shown, outcome.views, outcome.masks, advance_between(0.5, 0.95));
    if (!united) return propagate(united);

    // 9. Relocate.
    if (const auto going = stages.enter("relocate", u, fraction(0.95)); !going) return propagate(going);
    for (const std::size_t lost : relocate(working, request, positions))
      report.warnings.push_back("handle " + std::to_string(lost) + " has lost all its Gaussians in interval " +
                                std::to_string(u) + " and stays where it is");
    for (std::size_t i = 0; i < positions.size(); ++i)
      report.handles[i].relocated.push_back(positions[i] + working.origin);
    if (observer.interval_done && u < intervals)
      observer.interval_done({u, intervals, publish(working, scene, request.mode).cloud});
  }

  if (const auto going = stages.enter("finish", intervals, finish_from); !going) return propagate(going);
  dilate_masks(outcome.masks);
  Published published = publish(working, scene, request.mode);
  if (published.cloud.size() == 0)
    return fail(ErrorCode::unprocessable,
                "the edit would leave an empty scene: every Gaussian is dragged, and each has an opacity below 1/255, "
                "which a move removes; choose smaller radii, or mode extend",
                "handles");
  if (published.faint > 0)
    report.warnings.push_back(std::to_string(published.faint) +
                              " dragged Gaussians have an opacity below 1/255 and are left out");
  outcome.cloud = std::move(published.cloud);
  outcome.parent = std::move(published.parent);
  outcome.survivors = published.survivors;
  if (observer.interval_done) observer.interval_done({intervals, intervals, outcome.cloud});
  for (std::size_t v = 0; v < outcome.views.size(); ++v)
    report.views.push_back(
        {outcome.views[v].name, double(outcome.masks[v].area()) / double(outcome.masks[v].data.size())});
  report.output_gaussians = outcome.cloud.size();
  report.changeable = published.changeable;
  report.copies = outcome.cloud.size() - outcome.survivors;
  report.removed = scene.size() - outcome.survivors;
  stages.finish();
  return outcome;
}

}  // namespace engine::edit
