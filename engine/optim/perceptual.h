// How alike two pictures look, where an edit changes them: the term perceptual(I_r, I_e) * m of the loss.
// Source: 3DGS-Drag (ICLR 2025), the loss function; it takes LPIPS there. MsSsimLoss needs no weights: Wang,
// Simoncelli, Bovik 2003, "Multiscale structural similarity for image quality assessment", mixed with L1 as in Zhao et
// al. 2017, "Loss functions for image restoration with neural networks".
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "engine/optim/losses.h"
#include "engine/optim/picture_view.h"
#include "engine/scene/image.h"

namespace engine::optim {

/// A distance between two pictures of one size, differentiable in the first. One thread at a time may use an object.
class PerceptualLoss {
 public:
  virtual ~PerceptualLoss() = default;

  /// The distance; 0 for equal pictures, never negative but for rounding.
  ///   rendered, target  same size and channels, at least one pixel; what is outside them is unknown
  ///   v_rendered        gradient with respect to `rendered`: resized to it and overwritten
  ///   errors            those of the library behind it, if there is one, and what going_on() says
  [[nodiscard]] virtual Result<double> evaluate(const scene::Image& rendered, const scene::Image& target,
                                                scene::Image& v_rendered) = 0;

  /// Another text, other distances. Empty: they depend on nothing but the program.
  [[nodiscard]] virtual std::string identity() const { return {}; }

  /// An evaluation that takes long asks this, many times; the error that it returns ends it. Empty: it is not asked.
  void ask(std::function<Result<void>()> going_on) { going_on_ = std::move(going_on); }

 protected:
  [[nodiscard]] Result<void> going_on() const { return going_on_ ? going_on_() : Result<void>{}; }

 private:
  std::function<Result<void>()> going_on_;
};

/// The mix of MS-SSIM and L1.
struct MsSsimOptions {
  double ms_ssim_weight = 0.84;  ///< 0 to 1: alpha of Zhao et al., eq. 14; the L1 has the rest.
  double floor = 0.01;           ///< 0 to 1, exclusive: least mean term of a scale; below it, no gradient. A choice.
  L1Options l1 = {};
};
[[nodiscard]] Result<void> validate(const MsSsimOptions& options);

constexpr int max_ms_ssim_scales = 5;  ///< Wang 2003, section 3.2.

/// Scales for a picture of this size, 1 to 5: each halves the one before, and as long as the smaller side holds a
/// whole window of 11 pixels there is one more.
[[nodiscard]] int ms_ssim_scales(int width, int height);

/// Exponents of the `scales` finest scales, in order: Wang 2003, section 3.2, divided by their sum.
[[nodiscard]] std::vector<double> ms_ssim_weights(int scales);

/// ms_ssim_weight (1 - MS-SSIM) + (1 - ms_ssim_weight) mean |rendered - target|, the stand-in where there is no LPIPS.
///
/// Per channel, then averaged: the product over scales j of (mean contrast-structure term)^w_j, the last scale with
/// the full SSIM instead. Scales are means of 2 x 2 pixels (an odd last row or column is left out); windows are as in
/// ssim_loss(), zero outside. A mean term can be negative, where no power exists: it is clamped at `floor`.
/// Equal pictures: exactly 0, gradient exactly 0. About 1.5 times the cost of ssim_loss().
class MsSsimLoss final : public PerceptualLoss {
 public:
  explicit MsSsimLoss(const MsSsimOptions& options = {});  ///< Precondition: validate(options).
  [[nodiscard]] Result<double> evaluate(const scene::Image& rendered, const scene::Image& target,
                                        scene::Image& v_rendered) override;

 private:
  struct Scale {
    scene::Image rendered, target;  ///< Empty at the finest scale, where the caller's are used.
    scene::Image gradient;          ///< Gradient of the channel's mean of 1 - term; later that of the loss.
    std::vector<double> mean_loss;  ///< [channels] mean of 1 - term.
  };
  MsSsimOptions options_;
  LossWorkspace workspace_;
  std::vector<Scale> scales_;
};

/// Memory that a sequence of edit losses shares. One thread at a time may use it.
struct EditWorkspace {
  scene::Image composite, target, v_composite;
};

/// loss(m rendered + (1 - m) edited, edited) on a box of the view, times box area / view area, and its gradient: only
/// pixels of the mask are compared, and the pixels around them give context. An empty box is worth 0.
///   rendered, edited, mask, v_rendered  the same box of their pictures: by default the mask's bounding box
///   view_pixels                         pixels of the full view
///   weight                              of this loss in the total; only the gradient is multiplied by it
///   v_rendered                          weight * gradient is added, in pixels of the mask
///   dead_zone  colour units, 0 or more: a difference rendered - edited counts as nearer to zero by this, and one up to
///              this as none, so that half a step of an 8-bit picture keeps the rounding of `edited` from moving
///              anything. Above 0, brighter than 1 where `edited` is 1 counts as none too, as does darker than 0 where
///              it is 0: there 8 bits end
///   errors                              those of loss.evaluate()
[[nodiscard]] Result<double> edit_loss(PerceptualLoss& loss, PictureView rendered, PictureView edited, MaskView mask,
                                       std::size_t view_pixels, double weight, EditWorkspace& workspace,
                                       MutablePictureView v_rendered, float dead_zone = 0);

}  // namespace engine::optim
