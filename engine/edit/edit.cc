#include "engine/edit/edit.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "engine/edit/drag.h"
#include "engine/edit/handles.h"
#include "engine/edit/look.h"
#include "engine/edit/messages.h"
#include "engine/edit/optimise.h"
#include "engine/edit/paste.h"
#include "engine/edit/repair.h"
#include "engine/edit/stages.h"
#include "engine/edit/stretch.h"
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
  auto copies = drag_through(working, request, report.resolved.intervals, /*rotate_sh=*/false).copies;
  const bool moves = !copies.empty();
  if (!moves && request.params.optimise_unmoved) copies = dragged_rows(working);
  const auto target_areas = covered_areas(working, copies, candidates, advance_from(0));
  if (!target_areas) return propagate(target_areas);
  const auto sources = parents_of(working, copies);
  rewind(working, scene, handle);
  const auto source_areas = covered_areas(working, sources, candidates, advance_from(0.5));
  if (!source_areas) return propagate(source_areas);
  auto chosen = choose_views(candidates, *source_areas, *target_areas, request);
  if (!moves)
    report.warnings.push_back(nothing_moves());
  else if (chosen.empty())
    report.warnings.push_back("no view sees the edited part");
  return chosen;
}

/// Does the state belong to this request? What it says of the scene, restore() checks.
Result<void> check_resume(const Checkpoint& from, const Request& request) {
  const std::size_t handles = request.handles.size();
  bool fits = from.interval >= 1 && from.interval <= resolved_intervals(request) &&
              from.report.resolved.intervals == resolved_intervals(request) && from.positions.size() == handles &&
              from.report.handles.size() == handles && from.masks.size() == from.views.size() &&
              validate_cameras(from.views).has_value();
  for (std::size_t v = 0; fits && v < from.views.size(); ++v)
    fits = from.masks[v].width == from.views[v].width && from.masks[v].height == from.views[v].height;
  for (const std::uint16_t handle : from.members.handle) fits = fits && handle <= handles;
  if (!fits) return fail(ErrorCode::invalid_argument, "the checkpoint is of another edit", "checkpoint");
  return {};
}

/// One edit while it runs.
class Run {
 public:
  Run(const scene::GaussianCloud& scene, const Request& request, const Observer& observer,
      optim::PerceptualLoss& perceptual, correct::Corrector* corrector)
      : scene_(scene), request_(request), observer_(observer), perceptual_(perceptual), corrector_(corrector) {
    stages_.set_lengths(resolved_intervals(request), iterations_of_interval(request.params));
  }

  Result<void> start(std::span<const scene::Camera> cameras);
  Result<void> go_on(const Checkpoint& from, std::span<const scene::Camera> cameras);
  [[nodiscard]] int finished() const { return finished_; }
  [[nodiscard]] int intervals() const { return report_.resolved.intervals; }
  Result<void> next_interval();
  Result<Outcome> finish();

 private:
  using Clock = std::chrono::steady_clock;

  [[nodiscard]] double fraction(int u, double part) const {
    return intervals_from + (finish_from - intervals_from) * (u - 1 + part) / intervals();
  }
  /// Of an interval: what comes before the optimisation, which takes most of the time of an edit that has one.
  [[nodiscard]] double early(double part) const { return request_.params.iterations > 0 ? 0.1 * part : part; }
  /// A part of the a-th correction of interval u is done, its optimisation included.
  [[nodiscard]] double in_correction(int u, int a, double part) const {
    const double done = (a - 1 + part) / request_.params.annealing_steps;
    return fraction(u, early(0.95) + (0.95 - early(0.95)) * done);
  }
  [[nodiscard]] double corrected_to(int u, int a, double part) const {
    return in_correction(u, a, correcting() * part);
  }
  [[nodiscard]] double optimised_to(int u, int a, double part) const {
    return in_correction(u, a, correcting() + (1 - correcting()) * part);
  }
  [[nodiscard]] double correcting() const { return corrector_ != nullptr ? 0.3 : 0; }
  Result<void> mask(int u, std::span<const std::uint32_t> rows, double from, double to);
  Result<void> repair(int u);
  Result<Corrected> correct(int u, int a, std::span<const scene::Mask> dilated);
  Result<void> optimise(int u, int a, std::span<const scene::Mask> dilated, const Corrected& corrected);
  Result<void> show(const char* stage, int u, double part, std::span<const scene::Image> pictures = {});
  Result<void> hand_out_checkpoint(int u, Clock::time_point start);

  const scene::GaussianCloud& scene_;
  const Request& request_;
  const Observer& observer_;
  optim::PerceptualLoss& perceptual_;
  correct::Corrector* corrector_;
  std::vector<scene::Camera> observers_;  ///< That have seen the scene, if a corrector asks.
  Report report_;
  Stages stages_{observer_, report_.times};
  WorkingScene working_;
  std::vector<scene::Camera> views_;
  std::vector<scene::Mask> masks_;  ///< Undilated.
  std::vector<DVec3> positions_;
  std::optional<WorkingScene> original_;  ///< As the edit found it, for `repair_`.
  std::optional<Repair> repair_;
  std::vector<std::uint32_t> shown_;  ///< The rows of the last mask rendering, as long as they are as they were then.
  int finished_ = 0;
};

Result<void> Run::start(std::span<const scene::Camera> cameras) {
  // 1. Assign: P_h^i, and the start of the 3D mask M.
  if (auto going = stages_.enter("assign", 0, 0); !going) return going;
  const auto assignment = assign(scene_.mean, request_);
  if (!assignment) return propagate(assignment);
  working_ = begin(scene_, request_, assignment->handle);

  if (corrector_ != nullptr) observers_ = candidate_cameras(scene_, cameras, request_);

  // 2. Intervals.
  report_.resolved = request_.params;
  report_.resolved.intervals = resolved_intervals(request_);
  report_.input_gaussians = scene_.size();
  for (const std::size_t count : assignment->count) report_.handles.push_back({count, {}});

  if (auto going = stages_.enter("views", 0, views_from); !going) return going;
  auto views = choose_views(scene_, cameras, request_, assignment->handle, working_, stages_, report_);
  if (!views) return propagate(views);
  views_ = std::move(*views);
  for (const scene::Camera& view : views_) masks_.emplace_back(view.width, view.height);
  positions_ = handle_sources(working_, request_);
  return {};
}

Result<void> Run::go_on(const Checkpoint& from, std::span<const scene::Camera> cameras) {
  if (auto fits = check_resume(from, request_); !fits) return fits;
  if (corrector_ != nullptr) observers_ = candidate_cameras(scene_, cameras, request_);
  report_ = from.report;
  if (auto going = stages_.enter("assign", from.interval, fraction(from.interval, 1)); !going) return going;
  working_ = begin(scene_, request_, deform::HandleColumn(scene_.size(), 0));
  if (auto restored = restore(from.members, working_); !restored) return restored;
  views_ = from.views;
  masks_ = from.masks;
  positions_ = from.positions;
  finished_ = from.interval;
  return {};
}

Result<void> Run::mask(int u, std::span<const std::uint32_t> rows, double from, double to) {
  if (auto going = stages_.enter("mask", u, fraction(u, from)); !going) return going;
  return unite_masks(working_, rows, views_, masks_,
                     [&](double done) { return stages_.advance(fraction(u, from + (to - from) * done)); });
}

Result<void> Run::repair(int u) {
  std::vector<scene::Mask> dilated = masks_;
  dilate_masks(dilated);
  if (!request_.params.local_mask)
    for (scene::Mask& mask : dilated) std::fill(mask.data.begin(), mask.data.end(), std::uint8_t{1});
  for (int a = 1; a <= request_.params.annealing_steps; ++a) {
    Corrected corrected;
    if (corrector_ != nullptr) {
      auto pictures = correct(u, a, dilated);
      if (!pictures) return propagate(pictures);
      corrected = std::move(*pictures);
      if (a == request_.params.annealing_steps)
        if (auto shown = show("corrected", u, early(0.95), corrected.pictures); !shown) return shown;
    }
    if (auto optimised = optimise(u, a, dilated, corrected); !optimised) return optimised;
  }
  shown_.clear();
  return show("optimised", u, 0.95);
}

Result<Corrected> Run::correct(int u, int a, std::span<const scene::Mask> dilated) {
  if (auto going = stages_.enter("correct", u, corrected_to(u, a, 0)); !going) return propagate(going);
  if (!repair_) {
    original_ = begin(scene_, request_, deform::HandleColumn(scene_.size(), 0));
    const auto in_frame = [&](std::span<const scene::Camera> cameras) {
      std::vector<scene::Camera> out;
      for (const scene::Camera& camera : cameras)
        out.push_back(scene::fit_within(in_frame_of(working_, camera), request_.params.max_image_side));
      return out;
    };
    repair_.emplace(original_->cloud, in_frame(observers_), in_frame(views_), request_.params, request_.mode,
                    *corrector_);
  }
  auto outcome =
      repair_->correct(working_, dilated, u, a, [&](double done) { return stages_.advance(corrected_to(u, a, done)); });
  if (!outcome) return propagate(outcome);
  report_.seeds += outcome->seeds;
  return std::move(outcome->corrected);
}

Result<void> Run::optimise(int u, int a, std::span<const scene::Mask> dilated, const Corrected& corrected) {
  if (auto going = stages_.enter("optimise", u, optimised_to(u, a, 0)); !going) return going;
  const int before = (a - 1) * request_.params.iterations;
  const auto advance = [&](const OptimiseProgress& at) {
    return stages_.advance(optimised_to(u, a, double(at.iteration) / at.iterations), before + at.iteration, at.loss);
  };
  const auto outcome =
      edit::optimise(working_, scene_, views_, dilated, corrected, request_.params, u, a, perceptual_, advance);
  if (!outcome) return propagate(outcome);
  if (a == request_.params.annealing_steps) report_.losses.push_back(outcome->loss);
  return {};
}

Result<void> Run::show(const char* stage, int u, double part, std::span<const scene::Image> pictures) {
  if (!observer_.moment) return {};
  if (auto going = stages_.enter("renders", u, fraction(u, part)); !going) return going;
  const Published published = publish(working_, scene_, request_.mode);
  return observer_.moment({u, intervals(), stage, published.overlay, views_, pictures});
}

Result<void> Run::hand_out_checkpoint(int u, Clock::time_point start) {
  if (!observer_.interval_done) return {};
  if (auto going = stages_.enter("checkpoint", u, fraction(u, 0.97)); !going) return going;
  const Checkpoint checkpoint{u, members_of(working_), positions_, views_, masks_, report_};
  std::vector<DVec3> in_world;
  for (const DVec3& position : positions_) in_world.push_back(position + working_.origin);
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  std::optional<double> loss;
  if (!report_.losses.empty()) loss = report_.losses.back();
  return observer_.interval_done({u, intervals(), seconds, loss, std::move(in_world), checkpoint});
}

Result<void> Run::next_interval() {
  const int u = finished_ + 1;
  const auto start = Clock::now();
  if (auto shown = show("before", u, 0); !shown) return shown;

  // 3. Deform from the relocated handles to p_t'(u).
  if (auto going = stages_.enter("deform", u, fraction(u, 0)); !going) return going;
  const Step step = plan_step(working_, request_, positions_, u, intervals());

  // 6. 2D masks: the moving Gaussians before the deformation ... (unless the last picture showed exactly that)
  const bool forced = request_.params.optimise_unmoved;
  if (const auto& rows = forced ? step.rows : step.moving; rows != shown_)
    if (auto masked = mask(u, rows, 0, early(0.45)); !masked) return masked;

  // 4. Copy and paste.
  if (auto going = stages_.enter("deform", u, fraction(u, early(0.45))); !going) return going;
  shown_ = paste(working_, step.deformation, step.rows, request_.mode, request_.params.rotate_sh);
  if (corrector_ != nullptr && request_.params.iterations > 0) draw_out(working_);
  std::sort(shown_.begin(), shown_.end());
  if (forced) shown_ = dragged_rows(working_);
  if (auto shown = show("deformed", u, early(0.48)); !shown) return shown;

  // 6. ... and after it.
  if (auto masked = mask(u, shown_, early(0.5), early(0.95)); !masked) return masked;

  // 7. and 8. Correct and optimise, as often as annealing asks.
  if (request_.params.iterations > 0 && !shown_.empty())
    if (auto repaired = repair(u); !repaired) return repaired;

  // 9. Relocate.
  if (auto going = stages_.enter("relocate", u, fraction(u, 0.95)); !going) return going;
  for (const std::size_t lost : relocate(working_, request_, positions_))
    report_.warnings.push_back(handle_lost(lost, u));
  for (std::size_t i = 0; i < positions_.size(); ++i)
    report_.handles[i].relocated.push_back(positions_[i] + working_.origin);
  finished_ = u;
  return hand_out_checkpoint(u, start);
}

Result<Outcome> Run::finish() {
  if (auto going = stages_.enter("finish", finished_, finish_from); !going) return propagate(going);
  dilate_masks(masks_);
  Published published = publish(working_, scene_, request_.mode);
  const scene::Overlay& overlay = published.overlay;
  report_.output_gaussians = scene_.size() - overlay.removed.size() + overlay.added();
  if (report_.output_gaussians == 0) return tl::make_unexpected(leaves_nothing());
  if (published.faint > 0) report_.warnings.push_back(faint_left_out(published.faint));
  for (std::size_t v = 0; v < views_.size(); ++v)
    report_.views.push_back({views_[v].name, double(masks_[v].area()) / double(masks_[v].data.size())});
  report_.changeable = published.changeable;
  report_.copies = overlay.added();
  report_.removed = overlay.removed.size();
  stages_.finish();
  return Outcome{std::move(published.overlay), finished_ < intervals(), std::move(views_), std::move(masks_),
                 std::move(report_)};
}

}  // namespace

Result<Outcome> run(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras, const Request& request,
                    const Observer& observer, const Checkpoint* resume, optim::PerceptualLoss* perceptual,
                    correct::Corrector* corrector) {
  if (const auto valid = validate(request); !valid) return propagate(valid);
  if (const auto valid = validate_cameras(cameras); !valid) return propagate(valid);
  optim::MsSsimLoss ms_ssim;
  Run run(scene, request, observer, perceptual != nullptr ? *perceptual : ms_ssim, corrector);
  if (const auto ready = resume ? run.go_on(*resume, cameras) : run.start(cameras); !ready) return propagate(ready);
  const auto is_enough = [&] { return run.finished() > 0 && observer.keep && observer.keep(); };
  while (run.finished() < run.intervals() && !is_enough())
    if (const auto done = run.next_interval(); !done) return propagate(done);
  return run.finish();
}

}  // namespace engine::edit
