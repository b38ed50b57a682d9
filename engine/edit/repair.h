// Step 7, correct, and what it needs: views are corrected one after the other, outward from the best one, and what the
// first ones decide of places that nobody has seen is put into the scene as new Gaussians (step 4, seed), so that
// the next ones show it already.
// Source: 3DGS-Drag (ICLR 2025), section 3.4.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/correct/corrector.h"
#include "engine/edit/optimise.h"
#include "engine/edit/request.h"
#include "engine/edit/working_scene.h"
#include "engine/neighbours/point_index.h"
#include "engine/render/forward.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::edit {

/// Corrects the views of one edit. What it knows of the unedited scene is made once.
class Repair {
 public:
  /// `original`, `params` and `corrector` are kept by reference.
  ///   original  the scene as the edit began with it, in the frame of the edit
  ///   observers cameras that have seen it, in that frame
  ///   views     of the edit, in that frame, best first
  Repair(const scene::GaussianCloud& original, std::span<const scene::Camera> observers,
         std::vector<scene::Camera> views, const Params& params, Mode mode, correct::Corrector& corrector);

  struct Outcome {
    Corrected corrected;
    std::size_t seeds = 0;  ///< Rows appended.
  };
  /// The a-th correction of interval u.
  ///   masks    per view, dilated; views without a set pixel stay as they are
  ///   advance  called with the part that is done after each view; its error ends the correction
  [[nodiscard]] Result<Outcome> correct(WorkingScene& working, std::span<const scene::Mask> masks, int u, int a,
                                        const std::function<Result<void>(double)>& advance);

 private:
  struct Seen;
  struct Rows {
    std::vector<std::uint32_t> gone;     ///< Left their place, in a move.
    std::vector<std::uint32_t> moved;    ///< Copies.
    std::vector<std::uint32_t> dragged;  ///< Both, ascending.
  };
  /// What a view shows behind the dragged part.
  struct Background {
    scene::Image picture;
    scene::Mask filled;     ///< Pixels that were made up.
    std::size_t seeds = 0;  ///< Rows appended.
  };

  [[nodiscard]] Rows rows_of(const WorkingScene& working) const;
  /// Notes in each view what has been left so far, and keeps it from being learned from.
  void note_vacated(const Rows& rows, std::span<const scene::Mask> masks);
  /// Have views looked through this point before the edit?
  [[nodiscard]] bool is_free(DVec3 point) const;
  [[nodiscard]] Seen look(const WorkingScene& working, std::span<const std::uint32_t> hidden, std::size_t v);
  /// I_e of view v: what it shows now, what was filled in as it was filled in, and the rest corrected as well.
  [[nodiscard]] Result<scene::Image> correct_view(const WorkingScene& working, const Rows& rows,
                                                  const Background& background, const scene::Mask& mask, std::size_t v,
                                                  double strength, std::uint64_t key);
  [[nodiscard]] Result<scene::Image> corrected(scene::Image picture, const scene::Mask& mask, scene::Image trust,
                                               std::size_t v, double strength, std::uint64_t key);
  /// Lays what goes on behind the dragged part into the working scene as seeds.
  [[nodiscard]] Result<Background> complete_background(WorkingScene& working, const Rows& rows, std::size_t v,
                                                       double strength, std::uint64_t key);
  [[nodiscard]] const neighbours::PointIndex& inputs();

  const scene::GaussianCloud& original_;
  std::vector<scene::Camera> views_;
  const Params& params_;
  Mode mode_;
  correct::Corrector& corrector_;
  std::vector<float> observed_;             ///< Of observed_rows().
  std::vector<scene::Image> depth_before_;  ///< [1] Per view, of the first half of the light; 0: nothing.
  std::vector<correct::Example> buffer_;
  std::vector<scene::Mask> vacated_;  ///< Per view: what the part has left.
  render::Workspace workspace_;
  std::vector<float> trust_;  ///< Of the rows of the working scene, in the correction at hand.
  std::optional<neighbours::PointIndex> inputs_;
};

}  // namespace engine::edit
