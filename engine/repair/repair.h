// Step 7, correct, and what it needs: the walk over the views. They are corrected one after the other, outward from the
// best one, and what the first ones decide of places that nobody has seen is put into the scene as new Gaussians
// (step 4, seed), so that the next ones show it already. Where views are to be repainted, the walk does that alone, and
// all of them are repainted at once after it.
// Source: 3DGS-Drag (ICLR 2025), section 3.4, for the correction; the walk, trust and seeds are ours (ADRs 9 and 36).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/correct/corrector.h"
#include "engine/correct/repainter.h"
#include "engine/neighbours/point_index.h"
#include "engine/render/forward.h"
#include "engine/repair/closure.h"
#include "engine/repair/surfaces.h"
#include "engine/repair/unedited_views.h"
#include "engine/repair/witnesses.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"
#include "engine/working/mode.h"
#include "engine/working/working_scene.h"

namespace engine::repair {

using working::Mode;
using working::WorkingScene;

/// What one view shows of the place that the part has left.
struct Uncovered {
  /// What the part covered there, and covers no more or will not in the end, but for mere air.
  std::size_t pixels = 0;
  /// Those of them that show what no camera has seen, and where no surface was found to go on: what is there was
  /// painted in this view alone.
  std::size_t open = 0;
  scene::Rect open_box;  ///< Around them.
};

/// What the optimisation should reach.
struct Corrected {
  std::vector<scene::Image> pictures;  ///< I_e of each view, in its size. Empty: there was no corrector.
  /// [rows of the working scene] 0 to 1: the more, the slower a row may change; at 1 not at all. Empty: all may as they
  /// are drawn.
  std::vector<float> trust;
  std::size_t seeds = 0;             ///< Rows that the correction appended.
  std::vector<Uncovered> uncovered;  ///< Of each view; empty where nothing has left its place since it was last told.
};

/// Which correction it is.
struct Round {
  int interval = 1;      ///< u, from 1.
  int correction = 1;    ///< a, from 1.
  double strength = 0;   ///< S(a), 0 to 1.
  bool arrives = false;  ///< The interval is the last one: what moved stays where it is now.
};

/// Corrects the views of one edit. What it knows of the unedited scene is made once; from one correction to the next
/// nothing else is carried, so an edit that goes on after an interval makes a new one.
class Repair {
 public:
  ///   original   the scene as the edit found it, in the frame of the edit
  ///   observers  cameras that have seen it, in that frame
  ///   views      of the edit, in that frame, best first
  ///   healed     rows of it that are made anew although they were seen, in a move
  ///   arrival    [n][3] means of what moves, where it arrives in the end, if that is known: what it will have left is
  ///              completed as soon as it has begun to leave
  ///   seed       of all random choices
  ///   corrector  outlives this
  Repair(scene::GaussianCloud original, std::span<const scene::Camera> observers, std::vector<scene::Camera> views,
         std::span<const std::uint32_t> healed, std::vector<float> arrival, Mode mode, std::uint64_t seed,
         correct::Corrector& corrector);

  /// One correction of all views. Appends seeds to the working scene, and gives up what hides what is completed, or the
  /// part where it arrives. In its first correction an interval completes what it opens, the last one once more what
  /// has been left open; else seeds stay as they are.
  ///   masks    per view, dilated; views without a set pixel stay as they are
  ///   advance  called with the part that is done, after each view of either pass; its error ends the correction
  ///   errors   those of the corrector and of `advance`; internal: the corrector gave back something else than a
  ///            picture of the view's size
  [[nodiscard]] Result<Corrected> correct(WorkingScene& working, std::span<const scene::Mask> masks, const Round& round,
                                          const std::function<Result<void>(double)>& advance);

  /// The first half of a correction by a repainter: geometry is completed in every view, and only then the pictures are
  /// made, which show it and are not corrected. No row is held by trust. Otherwise as correct().
  [[nodiscard]] Result<Corrected> complete(WorkingScene& working, std::span<const scene::Mask> masks,
                                           const Round& round, const std::function<Result<void>(double)>& advance);
  /// The second half: all pictures are repainted in one call. Nothing outside a mask changes, and along its rim, as
  /// wide as masks are dilated, the new picture fades into the old one.
  ///   pictures  of complete()
  ///   masks     the same; views without a set pixel stay as they are, and without any the repainter is not asked
  ///   errors    those of the repainter and of `advance`; internal: it gave back something else than pictures of the
  ///             views' sizes, or a number that is not finite
  [[nodiscard]] Result<void> repaint(std::vector<scene::Image>& pictures, std::span<const scene::Mask> masks,
                                     const Round& round, correct::Repainter& repainter,
                                     const correct::Advance& advance) const;
  /// Seed of what a repainter leaves to chance as it learns before this interval.
  [[nodiscard]] std::uint64_t tuning_seed(int interval) const;
  /// What view v showed before the edit. [3]
  [[nodiscard]] const scene::Image& unedited(std::size_t v) const { return buffer_[v].picture; }

 private:
  struct ViewNow;
  enum class Purpose : std::uint32_t;
  struct Rows {
    std::vector<std::uint32_t> gone;      ///< Left their place, in a move.
    std::vector<std::uint32_t> vacating;  ///< Those of them that are the input's.
    std::vector<std::uint32_t> moved;     ///< Copies.
    std::vector<std::uint32_t> dragged;   ///< Gone or moved, ascending.
  };
  /// What a view shows behind the dragged part.
  struct Background {
    scene::Image picture;
    scene::Mask filled;     ///< Pixels that were made up.
    std::size_t seeds = 0;  ///< Rows appended.
    Uncovered uncovered;
  };

  /// A surface that was completed, as a camera shows it.
  struct Completed {
    const scene::Camera& camera;
    const scene::Image& surface;                            ///< [1] Inverse depth; 0: nothing was completed.
    std::function<bool(DVec2 pixel, double z)> was_within;  ///< Was the dragged part there, at this pixel and depth?

    struct Place {
      DVec2 pixel;
      double z = 0;         ///< Depth, world units.
      double relative = 0;  ///< Depth in parts of that of the surface.
    };
    /// Where a point lies by the surface; nothing where the camera shows none of it.
    [[nodiscard]] std::optional<Place> place_of(DVec3 point) const;
  };

  struct Telling {
    std::size_t view = 0;
    ContinuedSurfaces surfaces;  ///< In it.
  };

  /// What becomes of the pictures once what is behind the dragged part is completed.
  enum class Pictures {
    corrected_in_turn,  ///< Each is corrected before the next view is completed.
    shown_at_the_end    ///< They are what the scene shows when all are completed.
  };
  /// correct() and complete().
  [[nodiscard]] Result<Corrected> walk(WorkingScene& working, std::span<const scene::Mask> masks, const Round& round,
                                       Pictures pictures, const std::function<Result<void>(double)>& advance);
  [[nodiscard]] Rows rows_of(const WorkingScene& working) const;
  /// Notes in each view what has been left so far, and keeps it from being learned from.
  void note_vacated(const WorkingScene& working, const Rows& rows, std::span<const scene::Mask> masks);
  /// Those of these rows of the input whose place is empty with the moved rows at these means, or will be in the end.
  [[nodiscard]] std::vector<std::uint32_t> open_among(std::span<const std::uint32_t> left, const Array3& means,
                                                      const Rows& rows) const;
  /// Is a place empty, or will be, that was not before this interval? Else all that is to be completed has been.
  [[nodiscard]] bool opens_more(const WorkingScene& working, const Rows& rows) const;
  /// Completes what is to be before any view is, and finds out how the rest goes on.
  ///   advance_by  called with what is done, in views; its error ends it
  ///   seeds       the number of those appended is added
  ///   returns     the view that tells most
  [[nodiscard]] Result<std::size_t> survey_place(WorkingScene& working, Rows& rows, const Round& round,
                                                 const std::function<Result<void>(double)>& advance_by,
                                                 std::size_t& seeds);
  [[nodiscard]] ViewNow look(const WorkingScene& working, std::span<const std::uint32_t> hidden, std::size_t v);
  /// What view v shows now, what was filled in as it was filled in.
  [[nodiscard]] ViewNow completed_view(const WorkingScene& working, const Rows& rows, const Background& background,
                                       std::size_t v);
  /// I_e of view v: what it shows now, what was filled in as it was filled in, and the rest corrected as well.
  [[nodiscard]] Result<scene::Image> correct_view(const WorkingScene& working, const Rows& rows,
                                                  const Background& background, const scene::Mask& mask, std::size_t v,
                                                  const Round& round);
  [[nodiscard]] Result<scene::Image> ask_corrector(scene::Image picture, const scene::Mask& mask, scene::Image trust,
                                                   std::size_t v, std::vector<std::size_t> examples, const Round& round,
                                                   Purpose purpose);
  /// The seed of these choices; a corrector counts up from it.
  [[nodiscard]] std::uint64_t seed_for(Purpose purpose, std::size_t v, const Round& round) const;
  /// The surfaces that go on behind the dragged part in view v.
  [[nodiscard]] ContinuedSurfaces surfaces_behind(const ViewNow& now, std::size_t v, const Round& round) const;
  /// The view that shows most of what can be completed, and is to decide what is there: at an outline of what goes on,
  /// little of it is seen. The first one if nothing is to be completed.
  ///   looked  called after each view; its error ends the search
  [[nodiscard]] Result<Telling> most_telling_view(const WorkingScene& working, const Rows& rows, const Round& round,
                                                  const std::function<Result<void>()>& looked);
  /// Completes the surface that goes on at most pixels in a chart of it, before any view does, if enough around it is
  /// known: returns the number of seeds. What its texture repeats goes on; the corrector makes up the rest.
  [[nodiscard]] Result<std::size_t> complete_chart(WorkingScene& working, Rows& rows, const Telling& telling,
                                                   const Round& round);
  /// What has left, and rows that nobody has seen: without them shows what is known.
  [[nodiscard]] std::vector<std::uint32_t> left_out(const Rows& rows) const;
  /// Makes the closure of what the part has left.
  void close_place(const WorkingScene& working, const Rows& rows);
  /// What closes the place in view v where no surface goes on: [1] inverse depth; 0: nothing does.
  ///   surface  the same of those that go on
  [[nodiscard]] scene::Image closing(const WorkingScene& working, const Rows& rows, std::size_t v,
                                     const scene::Image& surface);
  /// Lays what goes on behind the dragged part into the working scene as seeds.
  [[nodiscard]] Result<Background> complete_background(WorkingScene& working, Rows& rows, std::size_t v,
                                                       const Round& round);
  /// What hangs as a veil before the part where it arrives goes.
  void clear_veils(WorkingScene& working, Rows& rows);
  /// Healed rows go, for good.
  void give_up_healed(WorkingScene& working) const;
  /// Takes the trust of what view v shows in vacated pixels and no camera has seen, neither by depth nor by the light
  /// that came through to it, and of what lay right under a stain.
  void doubt_unseen(const WorkingScene& working, const Rows& rows, std::size_t v, ViewNow& now);
  /// Finds the rows of the input that were seen through the blurred outline of what has moved by now.
  ///   looked  called after each view; its error ends the search
  [[nodiscard]] Result<void> find_tainted(const WorkingScene& working, const Rows& rows,
                                          const std::function<Result<void>()>& looked);
  /// Rows that nobody has seen and that would hide what was completed. Ascending.
  [[nodiscard]] std::vector<std::uint32_t> unseen_before(const WorkingScene& working, const Completed& completed) const;
  /// Tainted rows that lie on it, for the most part; none where what has left lay in it as well. Ascending.
  [[nodiscard]] std::vector<std::uint32_t> tainted_on(const WorkingScene& working, const Completed& completed) const;
  /// Rows of both leave.
  void clear_before(WorkingScene& working, Rows& rows, const Completed& completed) const;

  scene::GaussianCloud original_;
  std::vector<scene::Camera> views_;
  Mode mode_;
  std::uint64_t seed_;
  correct::Corrector& corrector_;
  std::vector<float> shown_;  ///< Of shown_rows().
  Witnesses witnesses_;
  std::vector<std::uint32_t> healed_;  ///< Ascending.
  std::vector<float> arrival_;         ///< [n][3] Means of what moves, where it arrives in the end, or empty.
  std::vector<scene::Mask> stained_;   ///< Per view: pixels that the healed rows made up.
  std::vector<std::uint32_t> veils_;   ///< Rows of the input that were given up as veils, ascending.
  std::vector<std::uint32_t> unseen_;  ///< Rows of the input that no camera has seen, ascending.
  UneditedViews unedited_;
  std::vector<correct::Example> buffer_;
  std::vector<std::uint32_t> tainted_;  ///< Rows of the input: find_tainted(). Ascending.
  std::vector<std::uint32_t> open_;     ///< Those whose place is empty, or will be in the end, ascending.
  std::vector<scene::Mask> vacated_;    ///< Per view: what the part has left.
  std::optional<Closure> closure_;      ///< Of what the part has left.
  std::vector<scene::Image> far_side_;  ///< Per view: of what the part has left. See far_side().
  render::Workspace workspace_;
  std::vector<float> trust_;                         ///< Of the rows of the working scene, in the correction at hand.
  std::optional<neighbours::PointIndex> originals_;  ///< Their means, in a move: seeds take after the nearest one.
};

}  // namespace engine::repair
