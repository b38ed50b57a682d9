// Training an adapter of low rank: the loss of a diffusion model, and the optimiser.
// Sources: Ho et al. 2020, "Denoising diffusion probabilistic models", eq. 14; Loshchilov and Hutter 2019, "Decoupled
// weight decay regularization", algorithm 2.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/diffusion/layers.h"
#include "engine/diffusion/tensor.h"
#include "engine/weights/networks.h"

namespace engine::diffusion {

/// What a step learns from. Of tensors that live as long as it is used; none is null.
struct NoisyBatch {
  const Tensor* latents;    ///< [B, 4, h, w], scaled, without noise.
  const Tensor* noise;      ///< As large, normal.
  const Tensor* timesteps;  ///< [B] int64, 0 to below the steps of training: how much of it.
  const Tensor* context;    ///< [B, 77, width] of the prompt.
};

/// sqrt(alpha) latents + sqrt(1 - alpha) noise, each picture at its own time step.
[[nodiscard]] Tensor noisy_latents(const weights::NoiseConfig& noise, const NoisyBatch& batch);

/// The mean squared difference between the noise and what the network takes for it; a single number, with a gradient.
/// `unet` and `configs` must outlive the way back (predict_noise()).
/// Throws what libtorch throws: add_gradient() turns it into an error.
[[nodiscard]] Tensor denoising_loss(const Model& unet, const weights::Configs& configs, const NoisyBatch& batch);

struct AdamWOptions {
  double learning_rate = 1e-4;  ///< Above 0.
  double beta1 = 0.9, beta2 = 0.999;
  double eps = 1e-8;
  double weight_decay = 1e-2;  ///< Of the learning rate, at each step.
};
/// errors  invalid_argument; `where` names the option
[[nodiscard]] Result<void> validate(const AdamWOptions& options);

/// AdamW on some tensors. One thread at a time may use an object.
class AdamW {
 public:
  /// Precondition: validate(options); the tensors have gradients from now on.
  AdamW(std::vector<Tensor> parameters, const AdamWOptions& options);
  AdamW(AdamW&&) noexcept;
  AdamW& operator=(AdamW&&) noexcept;
  ~AdamW();

  /// Of the steps from now on. Precondition: as validate() asks.
  void set_learning_rate(double learning_rate);
  void clear_gradients();
  /// Norm of all gradients together, as of the last backward().
  [[nodiscard]] double gradient_norm() const;
  void step();  ///< A tensor without a gradient stays.

  /// What the steps so far have left, beside the parameters.
  struct Moments {
    int steps = 0;
    std::vector<weights::FloatTensor> mean, square;  ///< Of gradients, for each tensor, as they decay.
  };
  [[nodiscard]] Moments moments() const;
  /// Goes on after those steps. Precondition: of as many tensors, in their shapes.
  void restore(const Moments& moments);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Adds the gradient of `share` times the loss to those of the parameters: batches that do not fit into memory, or
/// whose pictures are not of one size, are learned from one after the other.
///   where    of errors, of this and the functions below
///   returns  the loss
///   errors   too_large; internal
[[nodiscard]] Result<double> add_gradient(const Model& unet, const weights::Configs& configs, const NoisyBatch& batch,
                                          double share, const std::string& where = "fine_tune");
/// A step by the gradients that were added, of losses whose sum is `loss`.
///   errors   internal: the loss or a gradient is not finite, and nothing has changed
[[nodiscard]] Result<void> take_step(AdamW& optimiser, double loss, const std::string& where = "fine_tune");

/// One step: loss, gradients, and AdamW.
///   returns  the loss before the step
///   errors   internal: the loss or a gradient is not finite, and nothing has changed; too_large
[[nodiscard]] Result<double> training_step(const Model& unet, const weights::Configs& configs, const NoisyBatch& batch,
                                           AdamW& optimiser, const std::string& where = "fine_tune");

}  // namespace engine::diffusion
