// From a noisy picture to one without noise, as a prompt describes it.
// Source: Meng et al. 2022, "SDEdit"; Ho and Salimans 2021, "Classifier-free diffusion guidance", eq. 6.
#pragma once

#include <functional>
#include <span>

#include "engine/core/result.h"
#include "engine/correct/repainter.h"
#include "engine/diffusion/layers.h"
#include "engine/diffusion/scheduler.h"
#include "engine/diffusion/tensor.h"
#include "engine/weights/networks.h"

namespace engine::diffusion {

using correct::Advance;

/// The noise that is seen with the prompt, and `guidance` times as far from what is seen without it:
/// e_u + g (e_t - e_u).
///   latents   [1, 4, h, w]
///   contexts  [2, 77, width]: of the negative prompt, then of the prompt. With guidance 1 the first is not looked at
[[nodiscard]] Tensor guided_noise(const Model& unet, const weights::UNetConfig& config, const Tensor& latents,
                                  int timestep, const Tensor& contexts, double guidance);

/// Fills its argument with normal numbers for a call of the sampler.
using NoiseSource = std::function<void(std::span<float>)>;

/// All calls of a scheduler, beginning with latents at the noise of its first time step.
///   latents  [1, 4, h, w], float32 and contiguous; changed in place
///   noise    asked if the scheduler takes noise
///   advance  asked before each call; may be empty
///   errors   those of `advance`; internal: latents are no longer finite, which a checkpoint's or an adapter's great
///            numbers bring about
[[nodiscard]] Result<void> denoise(const Model& unet, const weights::UNetConfig& config, Scheduler& scheduler,
                                   Tensor& latents, const Tensor& contexts, double guidance, const NoiseSource& noise,
                                   const Advance& advance);

}  // namespace engine::diffusion
