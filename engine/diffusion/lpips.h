// LPIPS: how alike two pictures look to a network that was trained to tell what they show.
// Source: Zhang et al. 2018, "The unreasonable effectiveness of deep features as a perceptual metric", eq. 1, version
// 0.1; Simonyan and Zisserman 2015, "Very deep convolutional networks for large-scale image recognition" (VGG16).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>

#include "engine/core/result.h"
#include "engine/optim/perceptual.h"
#include "engine/scene/image.h"
#include "engine/weights/lpips_files.h"

namespace engine::diffusion {

/// What an evaluation with its gradient takes for each pixel, on one thread of the machine of docs/stable-diffusion.md;
/// and the network.
constexpr double lpips_pixel_seconds = 1.9e-5;
constexpr std::uint64_t lpips_pixel_bytes = 4200, lpips_network_bytes = std::uint64_t{60} << 20;

/// The sum over five depths of VGG16 of the weighted squared differences of its features, each scaled to length 1 over
/// its channels; the mean over places. Pictures are scaled from 0 to 1 to -1 to 1. A side below 16 pixels, which the
/// deepest features do not have, is drawn out to 16 by its last row or column. A place at which all features are zero
/// has no slope: its length is taken for constant.
class Lpips final : public optim::PerceptualLoss {
 public:
  ///   threads  of libtorch; 0: as many as it takes by itself
  ///   errors   those of weights::LpipsFiles::check(); corrupt_data: a number is not finite
  [[nodiscard]] static Result<std::unique_ptr<Lpips>> create(const weights::LpipsFiles& files, int threads = 0);
  ~Lpips() override;

  [[nodiscard]] std::string identity() const override { return digest_; }  ///< Of the files.

  /// errors  invalid_argument: the pictures are not of one size and three channels; internal: the distance, or its
  ///         gradient, is not finite; too_large; what is asked between two convolutions, on the way back too (ask())
  [[nodiscard]] Result<double> evaluate(const scene::Image& rendered, const scene::Image& target,
                                        scene::Image& v_rendered) override;

  /// The same of pictures in -1 to 1, which is how LPIPS itself takes them.
  [[nodiscard]] Result<double> evaluate_signed(const scene::Image& rendered, const scene::Image& target,
                                               scene::Image& v_rendered);

  /// The share of each depth in the value, the shallowest first; for tests and reports.
  [[nodiscard]] const std::array<double, 5>& shares() const { return shares_; }

 private:
  struct Network;
  Lpips(std::unique_ptr<const Network> network, std::string digest, int threads);
  std::unique_ptr<const Network> network_;
  std::string digest_;
  int threads_;
  std::array<double, 5> shares_{};  ///< Of the last evaluate().
};

}  // namespace engine::diffusion
