#include "engine/edit/edit.h"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

#include "engine/edit/annealing.h"
#include "engine/edit/drag.h"
#include "engine/edit/handles.h"
#include "engine/edit/masks.h"
#include "engine/edit/messages.h"
#include "engine/edit/optimise.h"
#include "engine/edit/paste.h"
#include "engine/edit/progress.h"
#include "engine/edit/publish.h"
#include "engine/edit/views.h"
#include "engine/edit/workload.h"
#include "engine/render/forward.h"
#include "engine/repair/repair.h"
#include "engine/repair/stretch.h"

namespace engine::edit {
namespace {

using Clock = std::chrono::steady_clock;
using Rows = std::vector<std::uint32_t>;

/// What stays the same while an edit runs, and what can be made again from that at any time.
struct Edit {
  const scene::GaussianCloud& input;
  const Request& request;
  const Observer& observer;
  optim::PerceptualLoss& perceptual;
  correct::Corrector* corrector;
  ProgressMeter progress;
  std::vector<scene::Camera> candidates = {};  ///< That views are chosen from; they have seen the scene.
  std::optional<repair::Repair> repair = {};   ///< What the unedited scene looks like to a corrector.
  Rows covered = {};                           ///< The rows that masks were last united with.

  [[nodiscard]] const Params& params() const { return request.params; }
  /// Step 8 takes place, and so step 7 where there is a corrector.
  [[nodiscard]] bool optimises() const { return params().iterations > 0; }
};

/// The scene as it would be published now, for an observer that wants to see it.
Result<void> show(const State& state, Edit& edit, int u, const char* moment,
                  std::span<const scene::Image> pictures = {}) {
  if (!edit.observer.moment) return {};
  if (auto going = edit.progress.enter(Stage::pictures, u); !going) return going;
  const Published published = publish(state.scene, edit.input, edit.request.mode);
  return edit.observer.moment({u, state.report.resolved.intervals, moment, published.overlay, state.views, pictures});
}

/// 1. Assign: P_h^i, the start of the 3D mask M. 2. Intervals: T, and the handles at their sources.
Result<State> assign_and_divide(Edit& edit) {
  if (auto going = edit.progress.enter(Stage::assign, 0); !going) return propagate(going);
  auto assignment = assign(edit.input.mean, edit.request);
  if (!assignment) return propagate(assignment);
  State state;
  state.scene = WorkingScene(edit.input, frame_of(edit.request), std::move(assignment->handle));
  state.positions = handle_sources(state.scene.frame(), edit.request);
  state.report.resolved = edit.params();
  state.report.resolved.intervals = resolved_intervals(edit.request);
  state.report.input_gaussians = edit.input.size();
  for (const std::size_t count : assignment->count) state.report.handles.push_back({count, {}});
  return state;
}

/// What the plan could not know before the dragged part was found, and cameras that may look at it.
void measure_work(const State& state, Edit& edit) {
  if (!edit.observer.progress) return;
  std::vector<std::uint32_t> dragged = state.scene.dragged_rows();
  for (std::uint32_t& row : dragged) row = state.scene.parent()[row];
  const std::span<const scene::Camera> cameras = edit.candidates.empty() ? std::span(state.views) : edit.candidates;
  Workload work = edit.progress.workload();
  work.dragged = dragged.size();
  work.covered = covered_part(edit.input, dragged, cameras);
  work.candidates = edit.candidates.size();
  work.views = state.views.empty() ? views_at_most(edit.candidates, edit.params()) : state.views.size();
  work.view_pixels = view_pixels(cameras, edit.params().max_image_side);
  work.frame = measured_frames(edit.input, cameras, edit.params().max_image_side);
  work.slowness = measured_slowness();
  edit.progress.set_out(work);
}

void count_views(const State& state, Edit& edit) {
  Workload work = edit.progress.workload();
  work.views = state.views.size();
  edit.progress.refine(work);
}

/// 5. Views: chosen by what they see of the source and of the fully deformed target.
Result<void> look_for_views(State& state, Edit& edit, std::span<const scene::Camera> cameras) {
  if (auto going = edit.progress.enter(Stage::views, 0); !going) return going;
  edit.candidates = candidate_cameras(edit.input, cameras, edit.request);
  measure_work(state, edit);
  auto& warnings = state.report.warnings;
  for (const std::string& name : edit.params().exclude_views)
    if (std::ranges::none_of(edit.candidates, [&](const scene::Camera& c) { return c.name == name; }))
      warnings.push_back(no_view_to_exclude(name));
  auto choice = choose_views(state.scene, edit.input, edit.candidates, edit.request, state.report.resolved.intervals,
                             [&](double part) { return edit.progress.advance(part); });
  if (!choice) return propagate(choice);
  if (!choice->moves)
    warnings.push_back(nothing_moves());
  else if (choice->views.empty())
    warnings.push_back(no_view_sees_it());
  state.views = std::move(choice->views);
  count_views(state, edit);
  for (const scene::Camera& view : state.views) state.masks.emplace_back(view.width, view.height);
  return {};
}

/// 3. Deform: from the relocated handles to p_t'(u). Nothing has moved yet.
Result<PlannedMotion> deform(const State& state, Edit& edit, int u) {
  if (auto going = edit.progress.enter(Stage::deform, u); !going) return propagate(going);
  return plan_motion(state.scene, edit.request, state.positions, u, state.report.resolved.intervals);
}

/// 4. Copy and paste. Where a corrector repairs what is torn, copies are drawn out with their surface.
Result<Rows> paste(State& state, Edit& edit, int u, const PlannedMotion& motion) {
  if (auto going = edit.progress.enter(Stage::deform, u); !going) return propagate(going);
  Rows copies = copy_and_paste(state.scene, motion, edit.request.mode, edit.params().rotate_sh);
  if (edit.corrector != nullptr && edit.optimises()) repair::draw_out(state.scene);
  if (edit.params().optimise_unmoved) copies = state.scene.dragged_rows();
  return copies;
}

/// 6. Masks: the pixels that these rows cover join the mask of each view.
Result<void> mask(State& state, Edit& edit, int u, const Rows& rows) {
  if (auto going = edit.progress.enter(Stage::mask, u); !going) return going;
  edit.covered = rows;
  return unite_masks(state.scene, rows, state.views, state.masks,
                     [&](double part) { return edit.progress.advance(part); });
}

/// The pixels of each view that corrections may change.
std::vector<scene::Mask> masks_to_edit(const State& state, const Edit& edit) {
  std::vector<scene::Mask> masks = dilated(state.masks);
  if (!edit.params().local_mask)
    for (scene::Mask& mask : masks) std::fill(mask.data.begin(), mask.data.end(), std::uint8_t{1});
  return masks;
}

repair::Repair make_repair(const State& state, const Edit& edit) {
  const working::Frame& frame = state.scene.frame();
  const auto in_frame = [&](std::span<const scene::Camera> cameras) {
    std::vector<scene::Camera> out;
    for (const scene::Camera& camera : cameras)
      out.push_back(scene::fit_within(frame.edit_from_world(camera), edit.params().max_image_side));
    return out;
  };
  return {frame.edit_from_world(edit.input),
          in_frame(edit.candidates),
          in_frame(state.views),
          edit.request.mode,
          edit.params().seed,
          *edit.corrector};
}

/// 7. without a corrector: I_e is what the deformation shows. In a move that is the scene without what has left: a
/// picture with the originals in it, however faint, would ask for them, and where there are many they came back.
repair::Corrected uncorrected(const State& state, const Edit& edit) {
  repair::Corrected out;
  const Rows gone = state.scene.rows_of(working::Role::original);
  if (edit.request.mode != Mode::move || gone.empty()) return out;
  render::Layers layers(state.scene.cloud());
  layers.hidden = gone;
  render::Workspace workspace;
  for (const scene::Camera& view : state.views) {
    render::Rendering rendering;
    render::forward(layers, state.scene.frame().edit_from_world(view), {}, {}, workspace, rendering);
    out.pictures.push_back(std::move(rendering.color));
  }
  return out;
}

/// 7. Correct: I_e of each view, and seeds where a surface goes on that nobody has seen.
Result<repair::Corrected> correct(State& state, Edit& edit, std::span<const scene::Mask> masks,
                                  const repair::Round& round) {
  if (edit.corrector == nullptr) return repair::Corrected{};
  if (!edit.repair) {
    if (auto going = edit.progress.enter(Stage::observe, round.interval); !going) return propagate(going);
    edit.repair.emplace(make_repair(state, edit));
  }
  if (auto going = edit.progress.enter(Stage::correct, round.interval); !going) return propagate(going);
  auto corrected =
      edit.repair->correct(state.scene, masks, round, [&](double part) { return edit.progress.advance(part); });
  if (corrected) state.report.seeds += corrected->seeds;
  return corrected;
}

/// 8. Optimise: M towards the corrected views inside the masks, towards the unedited scene outside.
Result<double> optimise(State& state, Edit& edit, std::span<const scene::Mask> masks, repair::Corrected corrected,
                        const repair::Round& round) {
  if (auto going = edit.progress.enter(Stage::set_up, round.interval); !going) return propagate(going);
  if (edit.corrector == nullptr) corrected = uncorrected(state, edit);
  const int before = (round.correction - 1) * edit.params().iterations;
  const auto advance = [&](const OptimiseProgress& at) {
    if (at.set_up < 1) return edit.progress.advance(at.set_up);
    if (at.iteration == 0) return edit.progress.enter(Stage::optimise, round.interval);
    return edit.progress.advance(double(at.iteration) / at.iterations, before + at.iteration, at.loss);
  };
  const auto outcome = edit::optimise(state.scene, edit.input, state.views, masks, corrected, edit.params(), round,
                                      edit.perceptual, advance);
  if (!outcome) return propagate(outcome);
  return outcome->loss;
}

/// 7. and 8., as often as annealing asks.
Result<void> correct_and_optimise(State& state, Edit& edit, int u) {
  const std::vector<scene::Mask> masks = masks_to_edit(state, edit);
  const int corrections = edit.params().annealing_steps;
  for (int a = 1; a <= corrections; ++a) {
    const repair::Round round{u, a, strength_of(edit.params(), a)};
    auto corrected = correct(state, edit, masks, round);
    if (!corrected) return propagate(corrected);
    if (a == corrections && edit.corrector != nullptr)
      if (auto shown = show(state, edit, u, "corrected", corrected->pictures); !shown) return shown;
    const auto loss = optimise(state, edit, masks, std::move(*corrected), round);
    if (!loss) return propagate(loss);
    if (a == corrections) state.report.losses.push_back(*loss);
  }
  return show(state, edit, u, "optimised");
}

/// 9. Relocate: each handle to where its Gaussians have gone.
Result<void> relocate_handles(State& state, Edit& edit, int u) {
  if (auto going = edit.progress.enter(Stage::relocate, u); !going) return going;
  for (const std::size_t lost : relocate(state.scene, edit.request, state.positions))
    state.report.warnings.push_back(handle_lost(lost, u));
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    state.report.handles[i].relocated.push_back(state.scene.frame().world_from_edit(state.positions[i]));
  return {};
}

/// Steps 3 to 9 of interval u.
Result<void> carry_out_interval(State& state, Edit& edit, int u) {
  if (auto shown = show(state, edit, u, "before"); !shown) return shown;
  const auto motion = deform(state, edit, u);
  if (!motion) return propagate(motion);
  const Rows& before = edit.params().optimise_unmoved ? motion->rows : motion->moving;
  if (edit.optimises() || before != edit.covered)
    if (auto masked = mask(state, edit, u, before); !masked) return masked;
  const auto copies = paste(state, edit, u, *motion);
  if (!copies) return propagate(copies);
  if (auto shown = show(state, edit, u, "deformed"); !shown) return shown;
  if (auto masked = mask(state, edit, u, *copies); !masked) return masked;
  if (edit.optimises() && !copies->empty())
    if (auto repaired = correct_and_optimise(state, edit, u); !repaired) return repaired;
  if (auto relocated = relocate_handles(state, edit, u); !relocated) return relocated;
  state.interval = u;
  return {};
}

Result<void> hand_out(State& state, Edit& edit, Clock::time_point begun) {
  if (!edit.observer.interval_done) return {};
  if (auto going = edit.progress.enter(Stage::checkpoint, state.interval); !going) return going;
  state.report.times = edit.progress.times();
  std::vector<DVec3> in_world;
  for (const DVec3& position : state.positions) in_world.push_back(state.scene.frame().world_from_edit(position));
  const double seconds = std::chrono::duration<double>(Clock::now() - begun).count();
  std::optional<double> loss;
  if (!state.report.losses.empty()) loss = state.report.losses.back();
  return edit.observer.interval_done(
      {state.interval, state.report.resolved.intervals, seconds, loss, std::move(in_world), state});
}

Result<State> next_interval(State state, Edit& edit) {
  const auto begun = Clock::now();
  if (auto done = carry_out_interval(state, edit, state.interval + 1); !done) return propagate(done);
  if (auto handed = hand_out(state, edit, begun); !handed) return propagate(handed);
  return state;
}

/// Where the edit starts: from the state that it goes on from, or from steps 1, 2 and 5.
Result<State> begin(Edit& edit, std::span<const scene::Camera> cameras, std::optional<State> from) {
  if (from) {
    edit.progress.go_on_after(from->interval);
    if (auto going = edit.progress.enter(Stage::assign, from->interval); !going) return propagate(going);
    if (edit.corrector != nullptr) edit.candidates = candidate_cameras(edit.input, cameras, edit.request);
    measure_work(*from, edit);
    if (edit.observer.assigned) edit.observer.assigned(from->report);
    return std::move(*from);
  }
  auto state = assign_and_divide(edit);
  if (!state) return state;
  if (edit.observer.assigned) edit.observer.assigned(state->report);
  if (auto found = look_for_views(*state, edit, cameras); !found) return propagate(found);
  return state;
}

Result<Outcome> finish(State state, Edit& edit) {
  if (auto going = edit.progress.enter(Stage::finish, state.interval); !going) return propagate(going);
  Published published = publish(state.scene, edit.input, edit.request.mode);
  const scene::Overlay& overlay = published.overlay;
  Report& report = state.report;
  report.output_gaussians = edit.input.size() - overlay.removed.size() + overlay.added();
  if (report.output_gaussians == 0) return tl::make_unexpected(leaves_nothing());
  if (published.faint > 0) report.warnings.push_back(faint_left_out(published.faint));
  std::vector<scene::Mask> masks = dilated(state.masks);
  for (std::size_t v = 0; v < state.views.size(); ++v)
    report.views.push_back({state.views[v].name, double(masks[v].area()) / double(masks[v].data.size())});
  report.changeable = published.changeable;
  report.copies = overlay.added();
  report.removed = overlay.removed.size();
  edit.progress.finish();
  report.times = edit.progress.times();
  return Outcome{std::move(published.overlay), state.interval < report.resolved.intervals, std::move(state.views),
                 std::move(masks), std::move(report)};
}

Result<void> validate_cameras(std::span<const scene::Camera> cameras) {
  for (std::size_t i = 0; i < cameras.size(); ++i)
    if (const auto valid = scene::validate(cameras[i]); !valid)
      return fail(valid.error().code, valid.error().message,
                  "cameras[" + std::to_string(i) + "]." + valid.error().where);
  return {};
}

/// What is known of it before anything is looked at.
Workload workload_of(const scene::GaussianCloud& scene, const Request& request, const Tools& tools,
                     const Observer& observer, int finished) {
  Workload work;
  work.gaussians = scene.size();
  work.intervals = resolved_intervals(request);
  work.finished = finished;
  work.corrections = request.params.annealing_steps;
  work.iterations = request.params.iterations;
  work.corrected = tools.corrector != nullptr;
  work.vacates = request.mode == Mode::move;
  work.shown = bool(observer.moment);
  work.pictured = observer.pictured;
  work.kept = bool(observer.interval_done);
  return work;
}

}  // namespace

Result<Outcome> run(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras, const Request& request,
                    const Tools& tools, const Observer& observer, std::optional<State> from) {
  if (const auto valid = validate(request); !valid) return propagate(valid);
  if (const auto valid = validate_cameras(cameras); !valid) return propagate(valid);
  optim::MsSsimLoss ms_ssim;
  Edit edit{scene,
            request,
            observer,
            tools.perceptual != nullptr ? *tools.perceptual : ms_ssim,
            tools.corrector,
            ProgressMeter(observer, workload_of(scene, request, tools, observer, from ? from->interval : 0),
                          from ? from->report.times : std::vector<StageTime>())};
  Result<State> state = begin(edit, cameras, std::move(from));
  const auto is_enough = [&] { return state->interval > 0 && observer.keep && observer.keep(); };
  while (state && state->interval < state->report.resolved.intervals && !is_enough())
    state = next_interval(std::move(*state), edit);
  if (!state) return propagate(state);
  return finish(std::move(*state), edit);
}

}  // namespace engine::edit
