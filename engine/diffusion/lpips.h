// LPIPS: how alike two pictures look to a network that was trained to tell what they show.
// Source: Zhang et al. 2018, "The unreasonable effectiveness of deep features as a perceptual metric", eq. 1, version
// 0.1; Simonyan and Zisserman 2015, "Very deep convolutional networks for large-scale image recognition" (VGG16).
#pragma once

#include <array>
#include <filesystem>
#include <memory>

#include "engine/core/result.h"
#include "engine/optim/perceptual.h"
#include "engine/scene/image.h"
#include "engine/weights/safetensors.h"

namespace engine::diffusion {

/// The sum over five depths of VGG16 of the weighted squared differences of its features, each scaled to length 1 over
/// its channels; the mean over places. Pictures are scaled from 0 to 1 to -1 to 1. A side below 16 pixels, which the
/// deepest features do not have, is drawn out to 16 by its last row or column. A place at which all features are zero
/// has no slope: its length is taken for constant.
class Lpips final : public optim::PerceptualLoss {
 public:
  /// From VGG16 as torchvision has it ("features.0.weight"; the rest of it is not looked at), and LPIPS's own weights
  /// ("lin0.model.1.weight").
  ///   errors  those of weights::TensorFile::open(); corrupt_data: a tensor is missing, of another shape, or not finite
  [[nodiscard]] static Result<std::unique_ptr<Lpips>> open(const std::filesystem::path& vgg16,
                                                           const std::filesystem::path& linear);
  [[nodiscard]] static Result<std::unique_ptr<Lpips>> create(const weights::TensorFile& vgg16,
                                                             const weights::TensorFile& linear);
  ~Lpips() override;

  /// errors  invalid_argument: the pictures are not of one size and three channels; internal: the distance, or its
  ///         gradient, is not finite; too_large
  [[nodiscard]] Result<double> evaluate(const scene::Image& rendered, const scene::Image& target,
                                        scene::Image& v_rendered) override;

  /// The same of pictures in -1 to 1, which is how LPIPS itself takes them.
  [[nodiscard]] Result<double> evaluate_signed(const scene::Image& rendered, const scene::Image& target,
                                               scene::Image& v_rendered);

  /// The share of each depth in the value, the shallowest first; for tests and reports.
  [[nodiscard]] const std::array<double, 5>& shares() const { return shares_; }

 private:
  struct Network;
  explicit Lpips(std::unique_ptr<const Network> network);
  std::unique_ptr<const Network> network_;
  std::array<double, 5> shares_{};  ///< Of the last evaluate().
};

}  // namespace engine::diffusion
