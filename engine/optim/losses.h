// How far a rendered picture is from a target, and the gradient of that with respect to the rendered picture.
// Source: 3DGS-Drag (ICLR 2025), the loss function, of which this is the background term
//   [lambda_1 L1(I_r, I_o) + lambda_ssim (1 - SSIM(I_r, I_o))] * (1 - m);
// Wang et al. 2004, "Image quality assessment: from error visibility to structural similarity", for SSIM;
// Charbonnier et al. 1994 for the smooth absolute value.
//
// Every mean is over all pixels of the full view, also where only a part of it is handed in: a loss of part of a view
// is that part's contribution. With rendered == target outside a rectangle `changed`, the crop of both pictures to
// with_rim(changed) has the same value as the full view (but for the order of the double sum) and, within `changed`,
// the same gradient to the bit.
//
// Values that are not finite, or beyond 1e9, give a loss and gradients that need not be finite; all others are.
// Same bytes for any number of threads; they may differ between instruction sets. Nothing here allocates once a
// LossWorkspace has seen a picture of the size.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/optim/picture_view.h"
#include "engine/scene/image.h"

namespace engine::optim {

/// Memory that a sequence of losses shares. One thread at a time may use it.
struct LossWorkspace {
  std::vector<double> partial;  ///< One sum per chunk of work.
  std::vector<double> sums;     ///< One per channel.
};

/// The ways of taking the kink off |d|.
///
/// dead_zone is the default: where the target is the scene's own picture, or one stored with 8 bits, a difference of
/// less than half a step is rounding and must not move anything. Adam divides a gradient by its own size, so that a
/// tiny one (which charbonnier still has) moves a parameter as far as a large one does; only zero stays put.
enum class SmoothL1 {
  dead_zone,    ///< max(0, |d| - scale). Gradient 0 for |d| <= scale (its kink included), sign(d) beyond.
  charbonnier,  ///< sqrt(d^2 + scale^2) - scale. Smooth; gradient d / sqrt(d^2 + scale^2).
};

/// Which smooth absolute value, and its scale.
struct L1Options {
  SmoothL1 kind = SmoothL1::dead_zone;
  double scale = 0.5 / 255.0;  ///< Colour units, 1e-6 to 1. Default: half a step of an 8-bit picture.
};
[[nodiscard]] Result<void> validate(const L1Options& options);

/// Mean over pixels and channels of smooth |rendered - target|, where masked pixels count as equal.
///   rendered, target  same size and channels (asserted), as is `mask` unless it has no data
///   mask              set: the pixel may be edited and is not compared
///   view_pixels       pixels of the full view, by which the mean divides
///   weight            of this loss in the total; only the gradient is multiplied by it
///   v_rendered        same size; weight * gradient is added
///   returns           the contribution of these pixels to the mean, not weighted
double smooth_l1_loss(PictureView rendered, PictureView target, MaskView mask, std::size_t view_pixels,
                      const L1Options& options, double weight, LossWorkspace& workspace, MutablePictureView v_rendered);

/// Pixels beyond a changed one that its SSIM gradient depends on: twice the radius of the window.
constexpr int ssim_rim = 10;

/// `changed` grown by ssim_rim on each side, cut to the picture; an empty rectangle stays empty.
[[nodiscard]] scene::Rect with_rim(scene::Rect changed, int width, int height);

/// 1 - SSIM, averaged over pixels and channels. Window of 11 x 11 pixels, Gaussian of sigma 1.5 px; pictures are zero
/// outside; C1 = 0.01^2, C2 = 0.03^2; each channel by itself. The map of SSIM is set to 1 at masked pixels before the
/// mean: they give no gradient, but a masked pixel still gets one through windows around pixels that are not masked.
/// Arguments and result as in smooth_l1_loss(). Equal pictures: exactly 0, gradient exactly 0.
///
/// Computed as a + b - ab with a = (mu_x - mu_y)^2 / C and b = var(x - y) / D, which is the same as 1 - SSIM but
/// does not lose the digits of a small difference, nor turn rounding into a gradient where pictures agree.
/// Stretches in which the pictures agree to the bit, or which are masked, are recognised and cost next to nothing.
/// All of a 640 x 359 picture, gradient included: 3.5 ms on one core with AVX-512, 4 ms with AVX2, half of that on two.
double ssim_loss(PictureView rendered, PictureView target, MaskView mask, std::size_t view_pixels, double weight,
                 LossWorkspace& workspace, MutablePictureView v_rendered);

/// Weights of the background term.
struct BackgroundLossOptions {
  double l1_weight = 8;    ///< lambda_1, 0 or more. Paper: 8, ten times the usual, to hold the background.
  double ssim_weight = 2;  ///< lambda_ssim, 0 or more. Paper: 2.
  L1Options l1 = {};
};
[[nodiscard]] Result<void> validate(const BackgroundLossOptions& options);

/// The background term and its parts, not weighted.
struct BackgroundLoss {
  double l1 = 0;     ///< The result of smooth_l1_loss().
  double ssim = 0;   ///< The result of ssim_loss(): 1 - SSIM.
  double total = 0;  ///< l1_weight * l1 + ssim_weight * ssim
};

/// The background term and its gradient, which is added to v_rendered. A loss of weight 0 is not computed.
BackgroundLoss background_loss(PictureView rendered, PictureView target, MaskView mask, std::size_t view_pixels,
                               const BackgroundLossOptions& options, LossWorkspace& workspace,
                               MutablePictureView v_rendered);

/// The factors of SSIM that a map holds.
enum class SsimTerm {
  full,                ///< Luminance times contrast-structure: SSIM.
  contrast_structure,  ///< (2 cov + C2) / (var_x + var_y + C2), what MS-SSIM takes at all scales but the last.
};

/// Sum over the pixels of 1 - term, per channel, and its gradient: the part that SSIM and MS-SSIM share.
///   scale  the gradient is multiplied by this and added to v_rendered
///   sums   [channels], overwritten
void ssim_sums(PictureView rendered, PictureView target, MaskView mask, SsimTerm term, float scale,
               LossWorkspace& workspace, MutablePictureView v_rendered, std::span<double> sums);

}  // namespace engine::optim
