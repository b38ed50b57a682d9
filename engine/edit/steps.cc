#include "engine/edit/steps.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <optional>
#include <string>
#include <utility>

#include "engine/core/rows.h"
#include "engine/deform/assign.h"
#include "engine/edit/handles.h"
#include "engine/edit/masks.h"
#include "engine/edit/messages.h"
#include "engine/edit/optimise.h"
#include "engine/edit/paste.h"
#include "engine/edit/publish.h"
#include "engine/edit/views.h"
#include "engine/edit/workload.h"
#include "engine/render/forward.h"
#include "engine/repair/outskirts.h"
#include "engine/repair/shadow.h"
#include "engine/repair/stretch.h"

namespace engine::edit {
namespace {

/// Where a move in several intervals takes its rows in the end: [n][3], in the frame of the edit. Empty for others:
/// where they go at once, everybody sees what they leave.
std::vector<float> arrival_of(const State& state, const Edit& edit) {
  const int intervals = state.report.resolved.intervals;
  if (intervals == 1 || departure_of(edit.request) != Mode::move) return {};
  const DraggedAlone drag = drag_alone(edit.input, edit.handle, edit.request, edit.parts, intervals);
  return interleaved(drag.working.cloud().mean, rows_where(drag.working.role(), working::has_arrived));
}

/// What a corrector is to know of the unedited scene.
repair::Repair make_repair(const State& state, const Edit& edit) {
  const working::Frame& frame = state.scene.frame();
  const auto in_frame = [&](std::span<const scene::Camera> cameras) {
    std::vector<scene::Camera> out;
    for (const scene::Camera& camera : cameras)
      out.push_back(scene::fit_within(frame.edit_from_world(camera), edit.params().max_image_side));
    return out;
  };
  return {frame.edit_from_world(edit.input), in_frame(edit.candidates),  in_frame(state.views), edit.request.healed,
          arrival_of(state, edit),           departure_of(edit.request), edit.params().seed,    *edit.corrector};
}

/// Makes the repair, if there is none yet.
Result<void> observe(const State& state, Edit& edit, int u) {
  if (edit.repair) return {};
  if (auto going = edit.progress.enter(Stage::observe, u); !going) return going;
  edit.repair.emplace(make_repair(state, edit));
  return {};
}

Uncovered uncovered_in(const scene::Camera& view, const repair::Uncovered& seen) {
  const double width = view.width, height = view.height, pixels = width * height;
  const scene::Rect& box = seen.open_box;
  return {view.name,
          double(seen.pixels) / pixels,
          double(seen.open) / pixels,
          {box.x0 / width, box.y0 / height},
          {box.x1 / width, box.y1 / height}};
}

/// Without a corrector I_e is what the scene shows before the optimisation. In a move that is without what has left: a
/// picture with the originals in it, however faint, would ask for them, and where there are many they came back.
class Uncorrected {
 public:
  Uncorrected(const State& state, Mode mode) : state_(state), layers_(state.scene.cloud()) {
    if (mode == Mode::move) gone_ = state.scene.rows_that_left();
    layers_.hidden = gone_;
  }
  Uncorrected(const Uncorrected&) = delete;
  Uncorrected& operator=(const Uncorrected&) = delete;
  [[nodiscard]] std::optional<scene::Image> picture(std::size_t v) {
    if (gone_.empty()) return std::nullopt;
    render::Rendering rendering;
    render::forward(layers_, state_.scene.frame().edit_from_world(state_.views[v]), {}, {}, workspace_, rendering);
    return std::move(rendering.color);
  }

 private:
  const State& state_;
  Rows gone_;
  render::Layers layers_;  ///< Points at gone_.
  render::Workspace workspace_;
};

bool is_at_rest(const Handle& handle) {
  return handle.is_anchor() || (handle.end() == handle.source && !handle.rotation && handle.scale.value_or(1) == 1);
}

/// Does all that moves go away as a whole? What is held, or rests at a handle, bends where it is, and what is behind it
/// is its inside. Of what does not move as a body nobody knows.
bool leaves_as_a_whole(const Edit& edit) {
  using How = deform::Attachment::How;
  if (edit.request.mode == Mode::remove) return true;
  const auto is_pinned = [&](int group) {
    return std::ranges::any_of(edit.request.handles,
                               [&](const Handle& handle) { return handle.group == group && is_at_rest(handle); });
  };
  return !edit.parts.attachments.empty() &&
         std::ranges::all_of(edit.parts.attachments, [&](const deform::Attachment& part) {
           return part.how == How::one_piece || (part.how == How::free && !is_pinned(part.group));
         });
}

/// What is selected leaves its place as a whole, and what it leaves is repaired.
bool repairs_a_departure(const Edit& edit) {
  return edit.corrector != nullptr && edit.optimises() && edit.request.selected && edit.request.mode != Mode::extend &&
         leaves_as_a_whole(edit);
}

bool has_outskirts(const Edit& edit) { return edit.request.crumbs != Crumbs::keep && repairs_a_departure(edit); }

/// How the only part moves, where it goes as one piece.
deform::RigidMotion motion_of_part(const State& state, const Edit& edit) {
  const deform::Attachment& part = edit.parts.attachments.front();
  const auto drags = interval_drags(state.scene.frame(), edit.request, edit.parts.corrected, state.positions, 1, 1);
  return deform::nearest_motion(drags, part.group, part.scales);
}

/// Is a part turned by so much that its shadow would be another one? The light does not turn with it.
bool turns_in_the_light(const State& state, const Edit& edit) {
  // Of half an angle of 30 degrees: a chair that is led around by 25 keeps its shadow; a door that is opened by 60 had
  // something dark beside it carried along.
  constexpr double least_cosine = 0.966;
  return std::abs(motion_of_part(state, edit).turn.w) < least_cosine;
}

/// Its shadow is that of one part, which arrives at once: else a shadow would be where nothing is yet. Whoever asks for
/// the shadow to be removed knows of one; else it goes along, as it is.
bool has_shadow(const State& state, const Edit& edit) {
  const bool is_one = edit.request.shadow != ShadowOfPart::keep && repairs_a_departure(edit) &&
                      state.report.resolved.intervals == 1 && edit.parts.attachments.size() <= 1;
  const bool goes_along = edit.request.shadow == ShadowOfPart::move && edit.request.mode == Mode::move;
  return is_one && !(goes_along && turns_in_the_light(state, edit));
}

/// May the edit change this row, though it is not selected? Not outside of the region; what is healed goes anyway, and
/// what is selected and rests where it is stays.
bool may_change(const State& state, const Edit& edit, std::uint32_t row) {
  const auto& region = edit.request.region;
  const bool is_outside =
      region && !deform::inside(deform::Box{region->center, region->size}, DVec3(edit.input.mean.get(row)));
  return !is_outside && !std::ranges::binary_search(edit.request.healed, row) &&
         state.scene.role()[row] == working::Role::frozen;
}

/// What pictures show to be of the part goes with it, what they never showed of it does not arrive, and what the part
/// has tinged gets other colours.
///   advance  called with the part that is done; its error ends it
Result<void> look_at_outskirts(State& state, Edit& edit, const ViewChoice& choice,
                               const std::function<Result<void>(double)>& advance) {
  const Request& request = edit.request;
  const Rows part = united(choice.moved, edit.given_up);
  auto outskirts = repair::outskirts_of(edit.input, part, choice.witnesses, advance);
  if (!outskirts) return propagate(outskirts);
  std::erase_if(outskirts->backing, [&](std::uint32_t row) { return !may_change(state, edit, row); });
  if (request.mode != Mode::remove)
    std::ranges::set_intersection(outskirts->buried, choice.moved, std::back_inserter(edit.buried));
  if (edit.buried.size() == choice.moved.size()) edit.buried.clear();  // else nothing would arrive
  edit.given_up = united(edit.given_up, outskirts->backing);
  if (!outskirts->backing.empty() || !edit.buried.empty())
    state.report.warnings.push_back(outskirts_go(outskirts->backing.size(), edit.buried.size()));
  std::erase_if(outskirts->through, [&](std::uint32_t row) { return !may_change(state, edit, row); });
  // What is healed goes, and lends its colour to nothing.
  std::erase_if(outskirts->clear, [&](std::uint32_t row) { return std::ranges::binary_search(request.healed, row); });
  const bool shade_stays = request.shadow == ShadowOfPart::keep;
  edit.tinged = repair::tinged_among(edit.input, outskirts->through, outskirts->clear, shade_stays);
  return {};
}

/// Where what is at a point around the part as it arrives would have been around it before; empty where its shadow does
/// not go along.
std::function<DVec3(DVec3)> back_to_source(const State& state, const Edit& edit) {
  if (edit.request.mode == Mode::remove || edit.request.shadow == ShadowOfPart::remove) return {};
  const working::Frame& frame = state.scene.frame();
  const deform::RigidMotion motion = motion_of_part(state, edit);
  return [motion, &frame](DVec3 point) {
    const DVec3 arrived = frame.edit_from_world(point) - motion.centre - motion.shift;
    return frame.world_from_edit(motion.centre + glm::conjugate(motion.turn) * arrived / motion.scale);
  };
}

/// What the part has kept the light from, and what it will.
///   part  rows that leave, ascending
Result<void> look_for_shadow(const State& state, Edit& edit, const Rows& part,
                             const std::function<Result<void>(double)>& advance) {
  auto around = repair::look_around(edit.input, part, state.views, advance);
  if (!around) return propagate(around);
  const repair::Shadow shadow(std::move(*around));
  repair::Relit all = repair::relit_rows(edit.input, part, shadow, back_to_source(state, edit));
  for (std::size_t k = 0; k < all.rows.size(); ++k) {
    const std::uint32_t row = all.rows[k];
    if (may_change(state, edit, row)) edit.relit.rows.push_back(row), edit.relit.light.push_back(all.light[k]);
  }
  return {};
}

/// Buried rows go where they are, and do not arrive: what is planned for them is taken back.
void hold_back(const Rows& buried, PlannedMotion& motion) {
  const auto is_buried = [&](std::uint32_t row) { return std::ranges::binary_search(buried, row); };
  for (std::size_t k = 0; k < motion.rows.size(); ++k)
    if (is_buried(motion.rows[k])) motion.deformation.moves[k] = 0;
  std::erase_if(motion.moving, is_buried);
}
void leave_buried(WorkingScene& working, const Rows& buried) {
  for (const std::uint32_t row : buried) {
    float& logit = working.gaussians().opacity_logit[row];
    logit = std::min(logit, working::keep_logit(Mode::move));
    working.leave_behind(row);
  }
}

}  // namespace

void plan_ahead(const State& state, Edit& edit) {
  if (!edit.observer.progress) return;  // measuring costs about ten small frames
  edit.progress.replan(measured(edit.progress.workload(), state, edit.input, edit.candidates, edit.params()));
}

Result<State> assign_and_divide(Edit& edit) {
  if (auto going = edit.progress.enter(Stage::assign, 0); !going) return propagate(going);
  auto taken = assign(edit.input, edit.request);
  if (!taken) return propagate(taken);
  edit.parts = parts_of(edit.input, taken->handle, edit.request);
  edit.handle = taken->handle;
  edit.given_up = std::move(taken->given_up);
  State state;
  state.report.parts = edit.parts.attachments;
  state.scene = WorkingScene(edit.input, frame_of(edit.request), std::move(taken->handle));
  state.positions = handle_sources(state.scene.frame(), edit.request);
  state.report.resolved = edit.params();
  state.report.resolved.intervals = resolved_intervals(edit.request);
  state.report.input_gaussians = edit.input.size();
  for (const std::size_t count : taken->count) state.report.handles.push_back({count, {}});
  state.report.crumbs = taken->crumbs;
  return state;
}

Result<void> look_for_views(State& state, Edit& edit, std::span<const scene::Camera> cameras) {
  if (auto going = edit.progress.enter(Stage::views, 0); !going) return going;
  edit.candidates = candidate_cameras(edit.input, cameras, edit.request);
  plan_ahead(state, edit);
  auto& warnings = state.report.warnings;
  for (const std::string& name : edit.params().exclude_views)
    if (std::ranges::none_of(edit.candidates, [&](const scene::Camera& c) { return c.name == name; }))
      warnings.push_back(no_view_to_exclude(name));
  const bool looks = has_outskirts(edit);  // which takes about as long as the choice
  auto choice =
      choose_views(state.scene, edit.input, edit.candidates, edit.request, edit.parts, state.report.resolved.intervals,
                   [&](double part) { return edit.progress.advance(looks ? part / 2 : part); });
  if (!choice) return propagate(choice);
  if (choice->moved.empty())
    warnings.push_back(nothing_moves());
  else if (choice->views.empty())
    warnings.push_back(no_view_sees_it());
  std::ranges::move(warnings_of(edit.parts), std::back_inserter(warnings));
  state.views = std::move(choice->views);
  if (Workload work = edit.progress.workload(); work.views != state.views.size()) {
    work.views = state.views.size();
    edit.progress.refine(work);
  }
  for (const scene::Camera& view : state.views) state.masks.emplace_back(view.width, view.height);
  const bool shades = has_shadow(state, edit);
  if (!choice->moved.empty() && looks)
    if (auto looked =
            look_at_outskirts(state, edit, *choice,
                              [&](double part) { return edit.progress.advance((1 + (shades ? part / 2 : part)) / 2); });
        !looked)
      return looked;
  if (!choice->moved.empty() && shades)
    if (auto looked = look_for_shadow(state, edit, united(choice->moved, edit.given_up),
                                      [&](double part) { return edit.progress.advance((3 + part) / 4); });
        !looked)
      return looked;
  Rows vanishing = united(united(edit.given_up, edit.buried), united(edit.relit.rows, edit.tinged.rows));
  if (edit.corrector != nullptr) vanishing = united(vanishing, edit.request.healed);
  if (vanishing.empty()) return {};
  return unite_masks(state.scene, vanishing, state.views, state.masks,
                     [&](double) { return edit.progress.advance(1); });
}

Result<PlannedMotion> deform(const State& state, Edit& edit, int u) {
  if (auto going = edit.progress.enter(Stage::deform, u); !going) return propagate(going);
  Memory memory;  // each interval has bodies of its own
  PlannedMotion motion =
      plan_motion(state.scene, edit.request, edit.parts, state.positions, u, state.report.resolved.intervals, memory);
  if (u == 1) hold_back(edit.buried, motion);
  return motion;
}

Result<Rows> paste(State& state, Edit& edit, int u, const PlannedMotion& motion) {
  if (auto going = edit.progress.enter(Stage::deform, u); !going) return propagate(going);
  Rows copies = copy_and_paste(state.scene, motion, departure_of(edit.request), edit.params().rotate_sh);
  if (u == 1 && !motion.moving.empty())
    for (const std::uint32_t row : edit.given_up) state.scene.give_up(row);
  if (u == 1) leave_buried(state.scene, edit.buried);
  if (u == 1 && !motion.moving.empty()) {
    state.report.relit = repair::relight(state.scene, edit.relit);
    repair::recolour(state.scene, edit.tinged);  // what its like lend it is in the light by then
  }
  // An elastic body has drawn its Gaussians out already.
  if (edit.corrector != nullptr && edit.optimises() && edit.params().interpolation != Interpolation::arap)
    repair::draw_out(state.scene);
  if (edit.params().optimise_unmoved) copies = state.scene.dragged_rows();
  return copies;
}

Result<void> mask(State& state, Edit& edit, int u, const Rows& rows) {
  if (auto going = edit.progress.enter(Stage::mask, u); !going) return going;
  edit.masked_rows = rows;
  return unite_masks(state.scene, rows, state.views, state.masks,
                     [&](double part) { return edit.progress.advance(part); });
}

std::vector<scene::Mask> masks_to_edit(const State& state, const Edit& edit) {
  std::vector<scene::Mask> masks = dilated(state.masks);
  if (!edit.params().local_mask)
    for (scene::Mask& mask : masks) std::fill(mask.data.begin(), mask.data.end(), std::uint8_t{1});
  return masks;
}

Result<void> tune(State& state, Edit& edit, std::span<const scene::Mask> masks, int u) {
  if (edit.repainter == nullptr) return {};
  if (auto observed = observe(state, edit, u); !observed) return observed;
  if (auto going = edit.progress.enter(Stage::tune, u); !going) return going;
  std::vector<correct::HistoryPicture> history;
  for (std::size_t v = 0; v < state.views.size(); ++v)
    history.push_back({.view = v, .picture = correct::as_bytes(edit.repair->unedited(v))});
  history.insert(history.end(), state.history.begin(), state.history.end());
  for (correct::HistoryPicture& picture : history) picture.box = scene::bounding_box(masks[picture.view]);
  const int steps = u == 1 ? edit.params().tuning_steps : edit.params().tuning_steps_later;
  auto tuned = edit.repainter->fine_tune(history, steps, edit.repair->tuning_seed(u),
                                         [&](double part) { return edit.progress.advance(part); });
  if (tuned) state.repainter = edit.repainter->state();
  return tuned;
}

Result<repair::Corrected> correct(State& state, Edit& edit, std::span<const scene::Mask> masks,
                                  const repair::Round& round) {
  if (edit.corrector == nullptr) return repair::Corrected{};
  if (auto observed = observe(state, edit, round.interval); !observed) return propagate(observed);
  if (auto going = edit.progress.enter(Stage::correct, round.interval); !going) return propagate(going);
  const auto advance = [&](double part) { return edit.progress.advance(part); };
  auto corrected = edit.repainter != nullptr ? edit.repair->complete(state.scene, masks, round, advance)
                                             : edit.repair->correct(state.scene, masks, round, advance);
  if (!corrected) return corrected;
  state.report.seeds += corrected->seeds;
  if (corrected->uncovered.empty()) return corrected;  // as it was before
  state.report.uncovered.clear();
  for (std::size_t v = 0; v < corrected->uncovered.size(); ++v)
    if (corrected->uncovered[v].pixels > 0)
      state.report.uncovered.push_back(uncovered_in(state.views[v], corrected->uncovered[v]));
  return corrected;
}

Result<void> repaint(State& state, Edit& edit, std::span<const scene::Mask> masks, const repair::Round& round,
                     std::vector<scene::Image>& pictures) {
  if (edit.repainter == nullptr) return {};
  if (auto going = edit.progress.enter(Stage::repaint, round.interval); !going) return going;
  auto repainted = edit.repair->repaint(pictures, masks, round, *edit.repainter,
                                        [&](double part) { return edit.progress.advance(part); });
  if (!repainted || round.correction < edit.params().annealing_steps) return repainted;
  for (std::size_t v = 0; v < pictures.size(); ++v)
    if (masks[v].area() > 0)
      state.history.push_back({correct::Origin::edited, round.interval, v, correct::as_bytes(pictures[v])});
  return {};
}

Result<std::optional<double>> optimise(State& state, Edit& edit, std::span<const scene::Mask> masks,
                                       repair::Corrected corrected, const repair::Round& round) {
  if (auto going = edit.progress.enter(Stage::set_up, round.interval); !going) return propagate(going);
  std::optional<Uncorrected> uncorrected;
  if (edit.corrector == nullptr) uncorrected.emplace(state, departure_of(edit.request));
  const auto picture = [&](std::size_t v) {
    return uncorrected ? uncorrected->picture(v) : std::optional(std::move(corrected.pictures[v]));
  };
  const int before = (round.correction - 1) * edit.params().iterations;
  const auto advance = [&](const OptimiseProgress& at) {
    if (at.set_up < 1) return edit.progress.advance(at.set_up);
    if (at.iteration == 0) return edit.progress.enter(Stage::optimise, round.interval);
    return edit.progress.advance(double(at.iteration) / at.iterations, before + at.iteration, at.loss);
  };
  // What has left is wanted back only where nobody has completed its place.
  Rows gone;
  if (!corrected.trust.empty() && departure_of(edit.request) == Mode::move) gone = state.scene.rows_that_left();
  const Goal goal{picture, corrected.trust, gone};
  return edit::optimise(state.scene, edit.input, state.views, masks, goal, edit.params(), round, edit.perceptual,
                        advance);
}

Result<void> relocate_handles(State& state, Edit& edit, int u) {
  if (auto going = edit.progress.enter(Stage::relocate, u); !going) return going;
  for (const std::size_t lost : relocate(state.scene, edit.request, state.positions))
    state.report.warnings.push_back(handle_lost(lost, u));
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    state.report.handles[i].relocated.push_back(state.scene.frame().world_from_edit(state.positions[i]));
  return {};
}

Result<void> show(const State& state, Edit& edit, int u, const char* moment, std::span<const scene::Image> pictures) {
  if (!edit.observer.moment) return {};
  if (auto going = edit.progress.enter(Stage::pictures, u); !going) return going;
  const Published published = publish(state.scene, edit.input, departure_of(edit.request));
  return edit.observer.moment({u, state.report.resolved.intervals, moment, published.overlay, state.views, pictures});
}

}  // namespace engine::edit
