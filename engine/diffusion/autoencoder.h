// Pictures to latents, an eighth of their size, and back.
// Source: Rombach et al. 2022, "High-resolution image synthesis with latent diffusion models", section 3.1; Kingma and
// Welling 2014, "Auto-encoding variational Bayes" (means and variances).
#pragma once

#include "engine/core/rng.h"
#include "engine/diffusion/layers.h"
#include "engine/diffusion/tensor.h"
#include "engine/weights/networks.h"

namespace engine::diffusion {

/// Means and log variances of a picture's latents, not yet scaled.
///   picture  [B, 3, H, W] in -1 to 1; H and W are multiples of pixels_per_latent()
///   returns  [B, 8, h, w]: 4 channels of means, then 4 of log variances, which lie in -30 to 20
[[nodiscard]] Tensor encode_moments(const Model& model, const weights::AutoencoderConfig& config,
                                    const Tensor& picture);

/// scaling_factor * (mean + standard deviation * noise).
///   moments  of encode_moments()
///   noise    [B, 4, h, w], normal
[[nodiscard]] Tensor sample_latents(const weights::AutoencoderConfig& config, const Tensor& moments,
                                    const Tensor& noise);
/// The same with noise that is drawn.
[[nodiscard]] Tensor sample_latents(const weights::AutoencoderConfig& config, const Tensor& moments, Rng& rng);

/// Pictures, [B, 3, H, W] of -1 to 1, as the autoencoder gives them back, of means: without noise.
[[nodiscard]] Tensor there_and_back(const Model& model, const weights::AutoencoderConfig& config,
                                    const Tensor& pictures);

/// The picture of scaled latents, [B, 3, H, W], about -1 to 1, not clamped.
[[nodiscard]] Tensor decode_latents(const Model& model, const weights::AutoencoderConfig& config,
                                    const Tensor& latents);

}  // namespace engine::diffusion
