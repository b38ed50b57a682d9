// Trains all of a small latent diffusion model from nothing, and writes it as a checkpoint that StableDiffusion opens.
// No edit needs this: it shows that the networks learn and that the loop around them works, where no weights are to be
// had. Sources: Rombach et al. 2022, "High-resolution image synthesis with latent diffusion models", sections 3.1 to
// 3.3, without the patch discriminator and the perceptual loss of 3.1; Kingma and Welling 2014, "Auto-encoding
// variational Bayes", eq. 10.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "engine/core/result.h"
#include "engine/scene/image.h"
#include "engine/weights/networks.h"

namespace engine::diffusion {

struct PretrainingOptions {
  std::string prompt;               ///< Of every picture. Half the pictures are learned without a prompt, by chance.
  double divergence_weight = 1e-4;  ///< Of the latents' divergence from a normal distribution, beside a pixel's error.
  double weight_decay = 1e-4;       ///< Of AdamW.
  std::uint64_t seed = 0;           ///< Same seed, same bytes, at a fixed number of libtorch's threads.
};

/// A step's losses.
struct AutoencoderLoss {
  double absolute = 0;    ///< Mean difference of pixels, of -1 to 1.
  double squares = 0;     ///< Mean square of it.
  double divergence = 0;  ///< From a normal distribution, mean over the latents' numbers.
};

/// A model while it is trained: first its autoencoder, then, of what that makes of pictures, its UNet. The text encoder
/// stays as random as it begins: all pictures have one prompt. One thread at a time may use an object.
class Pretraining {
 public:
  /// Networks of these configurations with random numbers. The tokenizer is CLIP's without merges.
  ///   errors  those of weights::validate(); invalid_argument ("text_encoder"): fewer pieces than the tokenizer has;
  ///           those of Tokenizer::encode(); too_large
  [[nodiscard]] static Result<Pretraining> begin(const weights::Configs& configs, const PretrainingOptions& options);
  Pretraining(Pretraining&&) noexcept;
  Pretraining& operator=(Pretraining&&) noexcept;
  ~Pretraining();

  /// A step of the autoencoder.
  ///   pictures  at least one; [3], 0 to 1, all of one size, a multiple of side_multiple()
  ///   errors    internal: the loss or a gradient is not finite, and no step was taken: the next draws the same noise;
  ///             too_large
  [[nodiscard]] Result<AutoencoderLoss> autoencoder_step(std::span<const scene::Image> pictures, double learning_rate);
  /// The picture as the autoencoder gives it back, of means.
  [[nodiscard]] Result<scene::Image> through_autoencoder(const scene::Image& picture) const;

  /// Sets the scaling factor so that latents of these pictures have unit variance, of at least one: between the
  /// autoencoder's steps and the UNet's.
  ///   returns  the factor
  ///   errors   internal: the latents do not differ at all, or are not finite; too_large
  [[nodiscard]] Result<double> scale_latents(std::span<const scene::Image> pictures);

  /// A step of the UNet, on fresh noise at fresh time steps. Returns its loss (denoising_loss()).
  ///   errors  as autoencoder_step()
  [[nodiscard]] Result<double> unet_step(std::span<const scene::Image> pictures, double learning_rate);
  /// The loss without learning, at noise and time steps that the seed alone says: what falls as the UNet learns.
  [[nodiscard]] Result<double> unet_loss(std::span<const scene::Image> pictures, std::uint64_t seed) const;

  [[nodiscard]] const weights::Configs& configs() const;

  /// The checkpoint as it is now, as a folder of diffusers: what is there is replaced, file by file.
  ///   errors  those of write_file(); unavailable: the folder cannot be made; too_large: memory
  [[nodiscard]] Result<void> write(const std::filesystem::path& folder) const;

 private:
  struct State;
  explicit Pretraining(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace engine::diffusion
