// The files of LPIPS: VGG16 as torchvision has it, and LPIPS's own weights, version 0.1.
// Sources: Simonyan and Zisserman 2015, "Very deep convolutional networks for large-scale image recognition"; Zhang et
// al. 2018, "The unreasonable effectiveness of deep features as a perceptual metric".
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <string>

#include "engine/core/result.h"
#include "engine/weights/networks.h"
#include "engine/weights/safetensors.h"

namespace engine::weights {

/// VGG16's convolutions, 3 x 3: place in `features`, and channels. A depth ends with the last of each width's run.
struct VggConvolution {
  int place;
  int in, out;
  bool ends_depth;  ///< Its features are compared; what comes after begins with half the size.
};
constexpr std::array<VggConvolution, 13> vgg_convolutions = {{{0, 3, 64, false},
                                                              {2, 64, 64, true},
                                                              {5, 64, 128, false},
                                                              {7, 128, 128, true},
                                                              {10, 128, 256, false},
                                                              {12, 256, 256, false},
                                                              {14, 256, 256, true},
                                                              {17, 256, 512, false},
                                                              {19, 512, 512, false},
                                                              {21, 512, 512, true},
                                                              {24, 512, 512, false},
                                                              {26, 512, 512, false},
                                                              {28, 512, 512, true}}};
constexpr std::size_t lpips_depths = 5;

/// Of a convolution: [out, in, 3, 3] and [out]. Of a depth's weights for `channels` features: [1, channels, 1, 1].
[[nodiscard]] TensorSpec vgg_weight(const VggConvolution& convolution);
[[nodiscard]] TensorSpec vgg_bias(const VggConvolution& convolution);
[[nodiscard]] TensorSpec lpips_weight(std::size_t depth, int channels);

/// Both files. What else VGG16's holds, its classifier, is not looked at.
struct LpipsFiles {
  TensorFile vgg16;   ///< "features.0.weight" and so on.
  TensorFile linear;  ///< "lin0.model.1.weight" and so on.

  /// errors  those of TensorFile::open() and of check()
  [[nodiscard]] static Result<LpipsFiles> open(const std::filesystem::path& vgg16, const std::filesystem::path& linear);
  /// Is every tensor there, in its shape and of a type that is read? Their numbers are not looked at.
  ///   errors  corrupt_data, unsupported; `where` is "FILE:TENSOR"
  [[nodiscard]] Result<void> check() const;
  /// Of all that is used of them. Precondition: check().
  [[nodiscard]] std::string digest() const;
};

}  // namespace engine::weights
