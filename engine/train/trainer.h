// Training of an edit's Gaussians amid frozen ones, towards pictures.
// Source: 3DGS-Drag (ICLR 2025), section 3.4, for the loss; Kerbl et al. 2023 for the rest.
//
// Per iteration one view:
//   L = background_loss(I_r, I_o) outside the mask + perceptual_weight * edit_loss(I_r, I_e) inside it,
// means over all pixels of the full view. Rendered and differentiated are the tiles that changeable Gaussians reach;
// all else of a view is kept (render::FrozenView). An iteration costs what they reach and how many they are, never the
// size of the scene, as long as what is kept has room in TrainOptions::frozen_memory. Same bytes for any number of
// threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/optim/losses.h"
#include "engine/optim/perceptual.h"
#include "engine/render/backward.h"
#include "engine/render/frozen_view.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"
#include "engine/train/cloud_adam.h"
#include "engine/train/densify.h"
#include "engine/train/options.h"
#include "engine/train/random_streams.h"
#include "engine/train/view.h"

namespace engine::train {

/// The Gaussians that are trained.
struct TrainedRows {
  scene::GaussianCloud cloud;
  std::vector<std::uint32_t> name;   ///< [rows] Number of each in messages; empty: its row.
  std::vector<float> mobility = {};  ///< [rows] Factor of each row's learning rates; empty: 1.
};

/// The result of one iteration.
struct IterationResult {
  int number = 0;        ///< Number of the iteration in the correction, from 0.
  std::size_t view = 0;  ///< Number of its view: see add_view().
  double loss = 0;       ///< Loss of that view, before the step.
};

/// The cost of an iteration, in counts that do not depend on the machine.
struct IterationCost {
  std::size_t tiles = 0;          ///< Tiles rendered and differentiated.
  std::size_t entries = 0;        ///< Entries of their lists.
  std::size_t frozen_splats = 0;  ///< Frozen splats in the view's region.
};

/// Trains the rows of one correction, view by view. One thread at a time may use an object.
class Trainer {
 public:
  /// Adam starts with moments 0.
  ///   frozen        kept by reference: its cloud and list outlive the trainer and stay as they are
  ///   changeable    of the degree of frozen.base
  ///   scene_extent  world units, see optim::position_scale()
  ///   loss          outlives the trainer
  /// Precondition: validate(options).
  Trainer(FrozenScene frozen, TrainedRows changeable, double scene_extent, const TrainOptions& options,
          optim::PerceptualLoss& loss);

  /// A view to train on. I_o is the picture in which `original` stands among the frozen Gaussians, at the place of the
  /// changeable ones; I_e is what the view shows now, rounded to 8 bits. Projects the scene once.
  ///   mask     in the camera's size; one without a set pixel: there is nothing to train, and the view is left out
  ///   returns  whether it was added. Views are numbered as they are added.
  bool add_view(const scene::Camera& camera, const scene::Mask& mask, const scene::GaussianCloud& original);
  [[nodiscard]] std::size_t views() const { return views_.size(); }
  [[nodiscard]] const TrainingView& view(std::size_t v) const { return views_[v]; }

  /// The picture of view v's region as the Gaussians are now.
  [[nodiscard]] scene::Image render(std::size_t v);
  /// Sets I_e of view v, rounded to 8 bits. A picture of its region.
  void set_edited(std::size_t v, scene::Image picture);

  /// Starts over with iteration 0 of a correction: learning rates are full again, Adam goes on.
  /// Precondition: views() > 0, iterations >= 1.
  void begin_correction(const RandomKey& key, int iterations);
  /// The next iteration of those that begin_correction() announced: view by view, in shuffled epochs.
  /// Every so often (DensifyOptions) rows that pictures pull at get children, which are appended. After that, and
  /// after the last iteration, children that came to stand nearer to a camera than the changeable part did when the
  /// correction began, by more than floater_distance, are removed: floaters.
  ///   errors  internal: a parameter, a gradient or the loss is not finite. `where` names the first
  ///           ("gaussian[12].opacity"; by TrainedRows::name; a child goes by its ancestor). Besides, the errors of
  ///           the loss. After an error the trainer must not be used any more.
  [[nodiscard]] Result<IterationResult> step();

  [[nodiscard]] const scene::GaussianCloud& cloud() const { return cloud_; }
  /// [rows] The row of the initial cloud that each comes from. Rows from initial_rows() on are children.
  [[nodiscard]] std::span<const std::uint32_t> ancestors() const { return ancestor_; }
  [[nodiscard]] std::size_t initial_rows() const { return initial_rows_; }
  [[nodiscard]] std::size_t floaters_removed() const { return floaters_; }
  [[nodiscard]] const IterationCost& last_cost() const { return cost_; }
  [[nodiscard]] std::size_t memory_bytes() const;

 private:
  /// Puts the changeable Gaussians as they are now into the view; widens it if they have left it.
  void merge_into(TrainingView& view);
  /// Lets go of what other views keep, until all of them stay within TrainOptions::frozen_memory.
  void evict_for(TrainingView& view);
  Result<double> differentiate(TrainingView& view);
  /// [rows] What the position rate of each is multiplied by, as it is now.
  std::span<const float> position_mobility();
  Result<void> adam_step(double decay);
  void densify();
  void remove_floaters();
  void note_depths(TrainingView& view);

  FrozenScene frozen_;
  scene::GaussianCloud cloud_;
  std::vector<std::uint32_t> name_;
  std::vector<float> mobility_;           ///< [rows] Children included; or empty.
  std::vector<float> position_mobility_;  ///< Of the last step.
  TrainOptions options_;
  optim::PerceptualLoss& loss_;
  std::size_t initial_rows_;
  double radius_, position_scale_;
  std::vector<std::uint32_t> ancestor_;
  std::vector<TrainingView> views_;
  std::uint64_t use_counter_ = 0;

  RandomKey key_;
  int iteration_ = 0, iterations_ = 0;
  std::vector<std::uint32_t> order_;
  std::size_t floaters_ = 0;
  IterationCost cost_;

  CloudAdam adam_;
  PositionGradientStatistic position_gradients_;
  render::LocalFrame frame_;
  render::Gradients gradients_;
  scene::Image rendered_, comparable_, v_rendered_;
  optim::LossWorkspace loss_workspace_;
  optim::EditWorkspace edit_workspace_;
};

}  // namespace engine::train
