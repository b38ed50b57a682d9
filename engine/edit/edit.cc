#include "engine/edit/edit.h"

#include <algorithm>
#include <cassert>
#include <chrono>
#include <iterator>
#include <string>
#include <utility>

#include "engine/edit/annealing.h"
#include "engine/edit/handles.h"
#include "engine/edit/masks.h"
#include "engine/edit/messages.h"
#include "engine/edit/publish.h"
#include "engine/edit/steps.h"
#include "engine/edit/views.h"
#include "engine/edit/workload.h"

namespace engine::edit {
namespace {

using Clock = std::chrono::steady_clock;

/// 7. and 8., as often as annealing asks.
Result<void> correct_and_optimise(State& state, Edit& edit, int u) {
  const std::vector<scene::Mask> masks = masks_to_edit(state, edit);
  const int corrections = edit.params().annealing_steps;
  if (auto tuned = tune(state, edit, masks, u); !tuned) return tuned;
  for (int a = 1; a <= corrections; ++a) {
    const repair::Round round{u, a, strength_of(edit.params(), a), u == state.report.resolved.intervals};
    auto corrected = correct(state, edit, masks, round);
    if (!corrected) return propagate(corrected);
    if (auto repainted = repaint(state, edit, masks, round, corrected->pictures); !repainted) return repainted;
    if (a == corrections && edit.corrector != nullptr)
      if (auto shown = show(state, edit, u, "corrected", corrected->pictures); !shown) return shown;
    const auto loss = optimise(state, edit, masks, std::move(*corrected), round);
    if (!loss) return propagate(loss);
    if (*loss) edit.loss = *loss;
  }
  if (edit.loss) state.report.losses.push_back(*edit.loss);
  return show(state, edit, u, "optimised");
}

/// Steps 3 to 9 of interval u.
Result<void> carry_out_interval(State& state, Edit& edit, int u) {
  edit.loss.reset();
  if (auto shown = show(state, edit, u, "before"); !shown) return shown;
  const auto motion = deform(state, edit, u);
  if (!motion) return propagate(motion);
  const Rows& before = edit.params().optimise_unmoved ? motion->rows : motion->moving;
  if (edit.optimises() || before != edit.masked_rows)
    if (auto masked = mask(state, edit, u, before); !masked) return masked;
  const auto copies = paste(state, edit, u, *motion);
  if (!copies) return propagate(copies);
  if (auto shown = show(state, edit, u, "deformed"); !shown) return shown;
  if (auto masked = mask(state, edit, u, *copies); !masked) return masked;
  if (edit.optimises() && (motion->removes || !copies->empty()))
    if (auto repaired = correct_and_optimise(state, edit, u); !repaired) return repaired;
  if (!motion->removes)  // nothing is left that a handle could be on
    if (auto relocated = relocate_handles(state, edit, u); !relocated) return relocated;
  state.interval = u;
  return {};
}

Result<void> hand_out(State& state, Edit& edit, Clock::time_point begun) {
  if (!edit.observer.interval_done) return {};
  if (auto going = edit.progress.enter(Stage::checkpoint, state.interval); !going) return going;
  state.report.times = edit.progress.times();
  const double seconds = std::chrono::duration<double>(Clock::now() - begun).count();
  return edit.observer.interval_done({state.interval, state.report.resolved.intervals, seconds, edit.loss,
                                      in_world(state.scene.frame(), state.positions), state});
}

Result<State> next_interval(State state, Edit& edit) {
  const auto begun = Clock::now();
  if (auto done = carry_out_interval(state, edit, state.interval + 1); !done) return propagate(done);
  if (auto handed = hand_out(state, edit, begun); !handed) return propagate(handed);
  return state;
}

/// Ends here what is done, or is to keep what there is. Before the first interval there is nothing to keep.
bool is_enough(const State& state, const Observer& observer) {
  if (state.interval >= state.report.resolved.intervals) return true;
  return state.interval > 0 && observer.keep && observer.keep();
}

/// The networks of an edit that goes on, as they were after its last interval.
Result<void> take_up_networks(const State& from, Edit& edit) {
  if (from.perceptual != edit.perceptual.identity())
    return fail(ErrorCode::conflict,
                "the files of the perceptual loss have changed since the edit began: what it has done so far does not "
                "go with what they would make of the rest; submit it again",
                "checkpoint");
  return edit.repainter != nullptr ? edit.repainter->restore(from.repainter) : Result<void>{};
}

/// Where the edit starts: from the state that it goes on from, or from steps 1, 2 and 5.
Result<State> begin(Edit& edit, std::span<const scene::Camera> cameras, std::optional<State> from) {
  if (from) {
    edit.progress.go_on_after(from->interval);
    if (auto going = edit.progress.enter(Stage::assign, from->interval); !going) return propagate(going);
    auto taken = assign(edit.input, edit.request);
    if (!taken) return propagate(taken);
    edit.parts = parts_of(edit.input, taken->handle, edit.request);
    edit.handle = std::move(taken->handle);
    from->report.parts = edit.parts.attachments;
    if (edit.corrector != nullptr) edit.candidates = candidate_cameras(edit.input, cameras, edit.request);
    plan_ahead(*from, edit);
    if (edit.observer.assigned) edit.observer.assigned(from->report);
    return std::move(*from);
  }
  auto state = assign_and_divide(edit);
  if (!state) return state;
  state->perceptual = edit.perceptual.identity();
  if (edit.repainter != nullptr) state->repainter = edit.repainter->state();
  if (edit.observer.assigned) edit.observer.assigned(state->report);
  if (auto found = look_for_views(*state, edit, cameras); !found) return propagate(found);
  return state;
}

Result<Outcome> finish(State state, Edit& edit) {
  if (auto going = edit.progress.enter(Stage::finish, state.interval); !going) return propagate(going);
  Published published = publish(state.scene, edit.input, departure_of(edit.request));
  const scene::Overlay& overlay = published.overlay;
  Report& report = state.report;
  report.output_gaussians = edit.input.size() - overlay.removed.size() + overlay.added();
  if (report.output_gaussians == 0) return tl::make_unexpected(leaves_nothing());
  if (std::string open = left_open(report.uncovered); !open.empty()) report.warnings.push_back(std::move(open));
  if (published.faint > 0) report.warnings.push_back(faint_left_out(published.faint));
  if (state.interval == report.resolved.intervals)
    std::ranges::move(handles_stop_short(edit.request, edit.parts, in_world(state.scene.frame(), state.positions)),
                      std::back_inserter(report.warnings));
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

/// What is known of the work before anything is looked at.
///   finished  intervals, by an edit that goes on
Workload work_ahead(const scene::GaussianCloud& scene, const Request& request, const Tools& tools,
                    const Observer& observer, int finished) {
  Workload work = workload_of(scene.size(), request, tools.corrector != nullptr);
  work.repainted = tools.repainter != nullptr;
  work.repaint_time = tools.repaint_time;
  work.perceptual_pixel_seconds = tools.perceptual_pixel_seconds;
  work.finished = finished;
  work.shown = bool(observer.moment);
  work.pictured = observer.pictured;
  work.kept = bool(observer.interval_done);
  return work;
}

/// As long as it lives, the perceptual loss asks the observer whether to go on.
class Asked {
 public:
  explicit Asked(Edit& edit) : loss_(edit.perceptual) {
    loss_.ask([&progress = edit.progress] { return progress.go_on(); });
  }
  ~Asked() { loss_.ask({}); }
  Asked(const Asked&) = delete;
  Asked& operator=(const Asked&) = delete;

 private:
  optim::PerceptualLoss& loss_;
};

}  // namespace

Result<Outcome> run(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras, const Request& request,
                    const Tools& tools, const Observer& observer, std::optional<State> from) {
  if (const auto valid = validate(request); !valid) return propagate(valid);
  if (const auto valid = validate_cameras(cameras); !valid) return propagate(valid);
  if (from && !is_of(scene, request, *from))
    return fail(ErrorCode::invalid_argument, "the state is of another edit", "checkpoint");
  assert(tools.repainter == nullptr || tools.corrector != nullptr);
  optim::MsSsimLoss ms_ssim;
  Edit edit{scene,
            request,
            observer,
            tools.perceptual != nullptr ? *tools.perceptual : ms_ssim,
            tools.corrector,
            tools.repainter,
            ProgressMeter(observer, work_ahead(scene, request, tools, observer, from ? from->interval : 0),
                          from ? from->report.times : std::vector<StageTime>())};
  const Asked asked(edit);
  const bool was_enough = from && is_enough(*from, observer);
  if (from && !was_enough)  // else nothing is left for networks to do
    if (auto taken = take_up_networks(*from, edit); !taken) return propagate(taken);
  Result<State> state = begin(edit, cameras, std::move(from));
  while (state && !was_enough && !is_enough(*state, observer)) state = next_interval(std::move(*state), edit);
  if (!state) return propagate(state);
  return finish(std::move(*state), edit);
}

}  // namespace engine::edit
