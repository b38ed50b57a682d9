// The network that tells noise from picture.
// Source: Rombach et al. 2022, "High-resolution image synthesis with latent diffusion models", section 3.3 and appendix
// E; Ronneberger et al. 2015, "U-Net"; Vaswani et al. 2017, "Attention is all you need" (attention, and the embedding
// of time steps, section 3.5).
#pragma once

#include "engine/diffusion/layers.h"
#include "engine/diffusion/tensor.h"
#include "engine/weights/networks.h"

namespace engine::diffusion {

/// The noise that it sees in noisy latents. With gradients, `model` and `config` must outlive the way back, on which
/// transformers are computed again.
///   latents    [B, 4, h, w]; h and w are multiples of 2^(levels - 1)
///   timesteps  [B] int64, 0 to 999: how noisy they are
///   context    [B, 77, context_width]: encode_text()
///   returns    [B, 4, h, w]
[[nodiscard]] Tensor predict_noise(const Model& model, const weights::UNetConfig& config, const Tensor& latents,
                                   const Tensor& timesteps, const Tensor& context);

}  // namespace engine::diffusion
