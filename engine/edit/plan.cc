#include "engine/edit/plan.h"

#include <algorithm>
#include <cmath>

#include "engine/edit/views.h"
#include "engine/repair/around_part.h"
#include "engine/repair/outskirts.h"
#include "engine/repair/witnesses.h"

namespace engine::edit {
namespace {

// What follows was measured on edits of the demo scene (150 k Gaussians; a ball of 4,245 and a leaf of 1,279, and the
// ball with three times its radius; with its cameras and without; presets preview, draft and standard; move and extend)
// on two cores of an Intel Xeon with AVX-512. docs/estimates.md has those edits, and others that had no part in it.
// Seconds are those of that machine: Workload::slowness says how this one compares. Frames are measured where the edit
// runs.

// A frame of a million Gaussians there, for plans without a measured one.
constexpr double frame_of_a_million_seconds = 25e-3, frame_pixel_seconds = 8e-9;

// A footprint renders the box around the part alone: what it takes of a frame's time for the Gaussians grows with the
// side of the box, which is the root of the part of the picture it covers; pixels are those of the box.
constexpr double footprint_part = 0.05, footprint_side_part = 1.1;
constexpr double unite_pixel_seconds = 1e-9;   // to make a mask of it and unite it with others
constexpr double dilate_pixel_seconds = 4e-9;  // the box filter of a dilation
constexpr double row_seconds = 2e-8;           // to copy one Gaussian, or look at it
constexpr double dome_row_seconds = 4e-7;      // rays of virtual cameras through a scene
constexpr double drag_row_seconds = 2e-7;      // to deform, paste or relocate one dragged Gaussian; bodies take longer
constexpr double observe_frames = 1.1;         // largest weights, or depth beside colour
constexpr double look_frames = 1.3;            // depth and trust beside colour
constexpr double outskirts_frames = 3;         // depths of the rest, weights of all; the part alone takes little
constexpr double surface_seconds = 8e-3;       // to find the surfaces that go on in a view
constexpr double index_row_seconds = 4e-7;     // a search tree of the scene, for seeds and outskirts
// The chart, the closure, and rows that nobody has seen, which are looked at in each view. Measured beside other work,
// on edits of the demo scene whose frames took as long as planned.
constexpr double unseen_row_seconds = 2.5e-7;
constexpr double seeds_of_dragged = 0.7;     // that a move is filled with: they are optimised, too
constexpr double changing_of_dragged = 0.3;  // that are not trusted fully: 3 to 48 in 100 on captured cases (ADR 71)
constexpr double fill_seconds = 3.2e-4, fill_power = 0.5;  // of the pixels of the box: large holes have coarse scales
constexpr double set_up_frames = 1.3,
                 set_up_row_seconds = 1e-6;  // a view projected, and what is dragged laid over it, twice
constexpr double iteration_seconds = 6.2e-4, iteration_row_seconds = 3.9e-7,
                 iteration_pixel_seconds = 1.3e-7;  // of the box
// Of a repainter whose time nobody knows: that of the smallest one there is, so that its stages have some.
constexpr double least_training_step_seconds = 0.05, least_picture_seconds = 0.1;
constexpr double jpeg_pixel_seconds = 1.5e-8;
constexpr double write_seconds = 2e-3;               // until a picture or a checkpoint is on disk
constexpr double checkpoint_pixel_seconds = 1.1e-9;  // masks, packed

/// The plan as it is made.
class Maker {
 public:
  explicit Maker(const Workload& work)
      : work_(work),
        n_(double(work.gaussians)),
        p_h_(double(work.dragged)),
        views_(double(work.views)),
        pixels_(double(work.view_pixels)),
        box_(work.covered * pixels_) {
    if (work.frame.gaussians <= 0 && work.frame.pixel <= 0)
      work_.frame = {frame_of_a_million_seconds * n_ / 1e6, frame_pixel_seconds};
  }

  std::vector<PlannedStage> operator()() && {
    add(Stage::assign, 0, slow(row_seconds * n_) + work_.assign_seconds);
    add(Stage::views, 0, choice());
    for (int u = 1; u <= work_.intervals; ++u) add_interval(u);
    add(Stage::finish, 0, slow(row_seconds * n_ + dilate_pixel_seconds * views_ * pixels_));
    return std::move(plan_);
  }

 private:
  void add(Stage stage, int u, double seconds) { plan_.push_back({stage, u, seconds}); }
  /// Seconds of the machine where they were measured, on this one.
  [[nodiscard]] double slow(double seconds) const { return work_.slowness * seconds; }

  [[nodiscard]] double frame() const { return work_.frame.of(work_.view_pixels); }
  [[nodiscard]] double footprint(double pixels) const {
    return (footprint_part + footprint_side_part * std::sqrt(work_.covered)) * work_.frame.gaussians +
           work_.frame.pixel * work_.covered * pixels + slow(unite_pixel_seconds * pixels);
  }

  /// To find out where everything goes in one interval.
  [[nodiscard]] double motion() const {
    return work_.drag_seconds > 0 ? work_.drag_seconds / work_.intervals : slow(drag_row_seconds * p_h_);
  }
  /// Virtual cameras, the dry run of the drag, and what all cameras see of its beginning and its end.
  [[nodiscard]] double choice() const {
    const double small = std::min(double(comparison_side * comparison_side), pixels_);
    const double dome = work_.virtual_views ? dome_row_seconds * n_ : 0;
    return slow(dome) + motion() * work_.intervals + 2 * double(work_.candidates) * footprint(small) + outskirts() +
           surroundings();
  }
  /// Is what a selected part leaves repaired, and so looked at before?
  [[nodiscard]] bool looks_around() const {
    return work_.selected && work_.corrected && work_.vacates && work_.iterations > 0;
  }
  /// What cameras show of the part, of the rest, and of both; and what is around what they show through its outline.
  [[nodiscard]] double outskirts() const {
    if (!looks_around()) return 0;
    const double pixels = std::min(double(repair::outskirts_side * repair::outskirts_side), pixels_);
    const double frame = work_.frame.gaussians + work_.frame.pixel * pixels;
    return double(std::min(work_.candidates, repair::outskirts_cameras)) *
               (outskirts_frames * frame + slow(row_seconds * n_)) +
           slow(index_row_seconds * n_);
  }

  /// What views show around the part without it.
  [[nodiscard]] double surroundings() const {
    if (!looks_around()) return 0;
    const double pixels = std::min(double(repair::side_around * repair::side_around), pixels_);
    return double(std::min(work_.views, repair::cameras_around)) * (work_.frame.gaussians + work_.frame.pixel * pixels);
  }

  /// What a moment shows.
  enum class Shows { as_before, given, rendered };
  void add_pictures(int u, Shows shows) {
    if (!work_.shown) return;
    const double rendered = shows == Shows::rendered ? frame() : 0;
    const double encoded = shows != Shows::as_before ? slow(jpeg_pixel_seconds * pixels_) : 0;
    add(Stage::pictures, u,
        slow(row_seconds * n_) + double(work_.pictured) * (rendered + encoded + slow(write_seconds)));
  }

  void add_interval(int u) {
    const double masks = views_ * footprint(pixels_);
    const bool optimises = work_.iterations > 0;
    add_pictures(u, u == 1 ? Shows::rendered : Shows::as_before);
    add(Stage::deform, u, motion());
    // Without an optimisation, what leaves its place is what the interval before has put there, and was united then.
    add(Stage::mask, u, u == 1 || optimises ? masks : 0);
    add(Stage::deform, u, slow(drag_row_seconds * p_h_));
    add_pictures(u, Shows::rendered);
    add(Stage::mask, u, masks + (optimises ? slow(dilate_pixel_seconds * views_ * pixels_) : 0));
    for (int a = 1; optimises && a <= work_.corrections; ++a) add_round(u, a);
    if (optimises) add_pictures(u, Shows::rendered);
    add(Stage::relocate, u, slow(drag_row_seconds * p_h_));
    if (work_.kept) add(Stage::checkpoint, u, slow(2 * write_seconds + checkpoint_pixel_seconds * views_ * pixels_));
  }

  /// A correction, and the optimisation after it.
  void add_round(int u, int a) {
    if (work_.corrected) add_correction(u, a);
    // Without a corrector, the scene without what has left is what the views should show: one more frame.
    const double frames = set_up_frames + (!work_.corrected && work_.vacates ? 1 : 0);
    add(Stage::set_up, u, views_ * (frames * frame() + slow(set_up_row_seconds * p_h_)));
    const double rows = work_.corrected && work_.vacates ? (changing_of_dragged + seeds_of_dragged) * p_h_ : p_h_;
    add(Stage::optimise, u,
        slow(work_.iterations * (iteration_seconds + iteration_row_seconds * rows +
                                 (iteration_pixel_seconds + work_.perceptual_pixel_seconds) * box_)));
  }

  void add_correction(int u, int a) {
    const bool first = u == work_.finished + 1 && a == 1;
    // Between the first interval and the last, nothing that the drag leaves is left to complete, mostly.
    const bool completes = work_.vacates && (work_.repainted || (a == 1 && (u == 1 || u == work_.intervals)));
    const double witnesses = work_.vacates ? double(std::min(work_.candidates, repair::most_witnesses)) : 0;
    if (first)
      add(Stage::observe, u,
          observe_frames * (double(work_.candidates) + witnesses + views_) * frame() +
              (work_.vacates && work_.intervals > 1 ? motion() * work_.intervals : 0) +
              slow((row_seconds + (work_.vacates ? index_row_seconds : 0)) * n_));
    const RepaintTime& repaint = work_.repaint_time;
    if (work_.repainted && a == 1)
      add(Stage::tune, u,
          slow((u == 1 ? work_.first_tuning : work_.later_tuning) *
               std::max(repaint.training_step, least_training_step_seconds)));
    // In a move each view is looked at without the part as well: to find the one that shows most of the hole, and to
    // fill it. Footprints say what was vacated, and which of it is filled already.
    const double filled = completes ? 2 * (look_frames * frame() + slow(surface_seconds)) + 5 * footprint(pixels_) +
                                          slow(fill_seconds * std::pow(box_, fill_power) + unseen_row_seconds * n_)
                                    : 0;
    add(Stage::correct, u, views_ * (look_frames * frame() + filled));
    if (work_.repainted)
      add(Stage::repaint, u, slow(views_ * std::max(repaint.of_picture(work_.mean_strength), least_picture_seconds)));
    if (a == work_.corrections) add_pictures(u, Shows::given);
  }

  Workload work_;
  double n_, p_h_, views_, pixels_;
  double box_;  ///< Pixels of the box around the part, in one view.
  std::vector<PlannedStage> plan_;
};

}  // namespace

std::vector<PlannedStage> plan_of(const Workload& work) { return Maker(work)(); }

double seconds_of(std::span<const PlannedStage> plan) {
  double sum = 0;
  for (const PlannedStage& stage : plan) sum += stage.seconds;
  return sum;
}

}  // namespace engine::edit
