#include "engine/edit/plan.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/edit/views.h"

namespace engine::edit {
namespace {

constexpr std::array<std::string_view, stage_count> names{"assign", "views",    "deform",   "mask",     "observe",    "correct",
                                                          "set_up", "optimise", "relocate", "pictures", "checkpoint", "finish"};

// A middling machine's frame, for plans without a measured one.
constexpr FrameTime usual_frame_of_a_million{30e-3, 1e-8};

constexpr double row_seconds = 2e-8;
constexpr double assign_row_seconds = 4e-8;
constexpr double dome_row_seconds = 1e-7;
constexpr double drag_row_seconds = 1e-6;
constexpr double footprint_share = 0.7;
constexpr double mask_pixel_seconds = 3e-9;
constexpr double observe_share = 0.9;
constexpr double index_row_seconds = 1e-6;
constexpr double correct_frames = 1.5;
constexpr double correct_pixel_seconds = 2e-7;
constexpr double fill_pixel_seconds = 1e-6;
constexpr double set_up_frames = 1.5;
constexpr double iteration_seconds = 3e-4, iteration_pixel_seconds = 1e-7, iteration_row_seconds = 1e-7;
constexpr double jpeg_pixel_seconds = 1.5e-8, write_seconds = 1e-3;
constexpr double checkpoint_row_seconds = 1e-7;

double pixels_of_comparison(const Workload& work) { return std::min(double(comparison_side * comparison_side), double(work.view_pixels)); }

/// The plan as it is made.
class Maker {
 public:
  explicit Maker(const Workload& work) : work_(work), n_(double(work.gaussians)), p_h_(double(work.dragged)), views_(double(work.views)), pixels_(double(work.view_pixels)) {
    if (work.frame.gaussians <= 0 && work.frame.pixel <= 0)
      work_.frame = {usual_frame_of_a_million.gaussians * n_ / 1e6, usual_frame_of_a_million.pixel};
  }

  std::vector<PlannedStage> operator()() && {
    add(Stage::assign, 0, assign_row_seconds * n_);
    add(Stage::views, 0, (work_.virtual_views ? dome_row_seconds * n_ : 0) + drag_row_seconds * p_h_ * work_.intervals + 2 * double(work_.candidates) * footprint(pixels_of_comparison(work_)));
    for (int u = 1; u <= work_.intervals; ++u) add_interval(u);
    add(Stage::finish, 0, row_seconds * n_ + views_ * mask_pixel_seconds * pixels_);
    return std::move(plan_);
  }

 private:
  void add(Stage stage, int u, double seconds) { plan_.push_back({stage, u, seconds}); }

  [[nodiscard]] double footprint(double pixels) const {
    return footprint_share * (work_.frame.gaussians + work_.frame.pixel * work_.covered * pixels) + mask_pixel_seconds * pixels;
  }
  [[nodiscard]] double frame() const { return work_.frame.of(work_.view_pixels); }

  void add_pictures(int u, double rendered) {
    if (!work_.shown) return;
    add(Stage::pictures, u, row_seconds * n_ + double(work_.pictured) * (rendered * frame() + jpeg_pixel_seconds * pixels_ + write_seconds));
  }

  void add_interval(int u) {
    const double masks = views_ * footprint(pixels_);
    const bool again = u > 1 && work_.iterations == 0;  // what is dragged is what was pasted
    add_pictures(u, u == 1 ? 1 : 0);
    add(Stage::deform, u, drag_row_seconds * p_h_);
    add(Stage::mask, u, again ? 0 : masks);
    add(Stage::deform, u, row_seconds * n_ + drag_row_seconds * p_h_);
    add_pictures(u, 1);
    add(Stage::mask, u, masks);
    for (int a = 1; work_.iterations > 0 && a <= work_.corrections; ++a) {
      if (work_.corrected) add_correction(u, a);
      add(Stage::set_up, u, views_ * (set_up_frames + (work_.corrected || !work_.vacates ? 0 : 1)) * frame());
      add(Stage::optimise, u, double(work_.iterations) * (iteration_seconds + iteration_pixel_seconds * work_.covered * pixels_ + iteration_row_seconds * p_h_));
    }
    if (work_.iterations > 0) add_pictures(u, 1);
    add(Stage::relocate, u, drag_row_seconds * p_h_);
    if (work_.kept) add(Stage::checkpoint, u, checkpoint_row_seconds * p_h_ + write_seconds);
  }

  void add_correction(int u, int a) {
    if (u == work_.finished + 1 && a == 1)
      add(Stage::observe, u, (observe_share * double(work_.candidates) + views_) * frame() + row_seconds * n_);
    const double looks = work_.vacates ? 2 : 1;
    add(Stage::correct, u, views_ * (looks * correct_frames * frame() + correct_pixel_seconds * pixels_ + looks * fill_pixel_seconds * work_.covered * pixels_) + (work_.vacates && u == work_.finished + 1 && a == 1 ? index_row_seconds * n_ : 0));
    if (a == work_.corrections) add_pictures(u, 0);
  }

  Workload work_;
  double n_, p_h_, views_, pixels_;
  std::vector<PlannedStage> plan_;
};

}  // namespace

std::string_view name_of(Stage stage) { return names[std::size_t(stage)]; }

std::optional<Stage> stage_named(std::string_view name) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) return std::nullopt;
  return Stage(found - names.begin());
}

std::vector<PlannedStage> plan_of(const Workload& work) { return Maker(work)(); }

double seconds_of(std::span<const PlannedStage> plan) {
  double sum = 0;
  for (const PlannedStage& stage : plan) sum += stage.seconds;
  return sum;
}

}  // namespace engine::edit
