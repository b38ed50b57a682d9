#include "engine/diffusion/training.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/mse_loss.h>
#include <ATen/ops/zeros_like.h>

#include <cassert>
#include <cmath>
#include <utility>

#include "engine/diffusion/guard.h"
#include "engine/diffusion/numbers.h"
#include "engine/diffusion/scheduler.h"
#include "engine/diffusion/unet.h"

namespace engine::diffusion {

Tensor noisy_latents(const weights::NoiseConfig& noise, const NoisyBatch& batch) {
  const std::vector<double> alphas = alphas_cumprod(noise);
  const std::int64_t count = batch.timesteps->size(0);
  Tensor of_picture = at::empty({count, 1, 1, 1}, at::kFloat), of_noise = at::empty({count, 1, 1, 1}, at::kFloat);
  const Tensor timesteps = batch.timesteps->contiguous();
  for (std::int64_t i = 0; i < count; ++i) {
    const std::int64_t timestep = timesteps.data_ptr<std::int64_t>()[i];
    assert(timestep >= 0 && timestep < std::int64_t(alphas.size()));
    const double alpha = alphas.at(std::size_t(timestep));
    of_picture.data_ptr<float>()[i] = float(std::sqrt(alpha));
    of_noise.data_ptr<float>()[i] = float(std::sqrt(1 - alpha));
  }
  return *batch.latents * of_picture + *batch.noise * of_noise;
}

Tensor denoising_loss(const Model& unet, const weights::Configs& configs, const NoisyBatch& batch) {
  const Tensor predicted =
      predict_noise(unet, configs.unet, noisy_latents(configs.noise, batch), *batch.timesteps, *batch.context);
  return at::mse_loss(predicted, *batch.noise);
}

Result<void> validate(const AdamWOptions& options) {
  const auto refused = [](const char* option, const char* expected) {
    return fail(ErrorCode::invalid_argument, std::string("expected ") + expected, option);
  };
  if (!(options.learning_rate > 0 && options.learning_rate <= 1)) return refused("learning_rate", "above 0, up to 1");
  if (!(options.beta1 >= 0 && options.beta1 < 1)) return refused("beta1", "0 to below 1");
  if (!(options.beta2 >= 0 && options.beta2 < 1)) return refused("beta2", "0 to below 1");
  if (!(options.eps > 0)) return refused("eps", "above 0");
  if (!(options.weight_decay >= 0 && options.weight_decay <= 1)) return refused("weight_decay", "0 to 1");
  return {};
}

struct AdamW::State {
  AdamWOptions options;
  std::vector<Tensor> parameters, mean, square;  ///< Of gradients, decaying.
  int steps = 0;
};

AdamW::AdamW(std::vector<Tensor> parameters, const AdamWOptions& options) : state_(std::make_unique<State>()) {
  assert(validate(options));
  state_->options = options;
  state_->parameters = std::move(parameters);
  for (Tensor& parameter : state_->parameters) {
    state_->mean.push_back(at::zeros_like(parameter));
    state_->square.push_back(at::zeros_like(parameter));
    parameter.requires_grad_();
  }
}
AdamW::AdamW(AdamW&&) noexcept = default;
AdamW& AdamW::operator=(AdamW&&) noexcept = default;
AdamW::~AdamW() = default;

void AdamW::set_learning_rate(double learning_rate) {
  state_->options.learning_rate = learning_rate;
  assert(validate(state_->options));
}

void AdamW::clear_gradients() {
  for (Tensor& parameter : state_->parameters) parameter.mutable_grad().reset();
}

double AdamW::gradient_norm() const {
  double sum = 0;
  for (const Tensor& parameter : state_->parameters)
    if (parameter.grad().defined()) sum += parameter.grad().to(at::kDouble).pow(2).sum().item<double>();
  return std::sqrt(sum);
}

void AdamW::step() {
  const at::NoGradGuard no_gradients;
  const AdamWOptions& options = state_->options;
  ++state_->steps;
  const double unbias_mean = 1 - std::pow(options.beta1, state_->steps);
  const double unbias_square = 1 - std::pow(options.beta2, state_->steps);
  for (std::size_t i = 0; i < state_->parameters.size(); ++i) {
    Tensor &parameter = state_->parameters[i], &mean = state_->mean[i], &square = state_->square[i];
    const Tensor gradient = parameter.grad();
    if (!gradient.defined()) continue;
    mean.mul_(options.beta1).add_(gradient, 1 - options.beta1);
    square.mul_(options.beta2).addcmul_(gradient, gradient, 1 - options.beta2);
    const Tensor deviation = (square / unbias_square).sqrt() + options.eps;
    parameter.mul_(1 - options.learning_rate * options.weight_decay);
    parameter.addcdiv_(mean, deviation, -options.learning_rate / unbias_mean);
  }
}

AdamW::Moments AdamW::moments() const {
  Moments moments{state_->steps, {}, {}};
  for (const Tensor& mean : state_->mean) moments.mean.push_back(values_of(mean));
  for (const Tensor& square : state_->square) moments.square.push_back(values_of(square));
  return moments;
}

void AdamW::restore(const Moments& moments) {
  assert(moments.mean.size() == state_->mean.size() && moments.square.size() == state_->square.size());
  state_->steps = moments.steps;
  for (std::size_t i = 0; i < state_->mean.size(); ++i) {
    state_->mean[i] = tensor_of(moments.mean[i]);
    state_->square[i] = tensor_of(moments.square[i]);
  }
}

Result<double> add_gradient(const Model& unet, const weights::Configs& configs, const NoisyBatch& batch, double share,
                            const std::string& where) {
  return guarded(where, [&]() -> Result<double> {
    const at::AutoGradMode gradients(true);
    const Tensor loss = denoising_loss(unet, configs, batch);
    const double value = loss.item<double>();
    (loss * share).backward();
    return value;
  });
}

Result<void> take_step(AdamW& optimiser, double loss, const std::string& where) {
  return guarded(where, [&]() -> Result<void> {
    // A poisoned gradient must not reach the parameters, which would carry it into every picture from then on.
    if (!std::isfinite(loss) || !std::isfinite(optimiser.gradient_norm()))
      return fail(ErrorCode::internal, "the loss of training, or its gradient, is not finite", where);
    optimiser.step();
    return {};
  });
}

Result<double> training_step(const Model& unet, const weights::Configs& configs, const NoisyBatch& batch,
                             AdamW& optimiser, const std::string& where) {
  optimiser.clear_gradients();
  const auto loss = add_gradient(unet, configs, batch, 1, where);
  if (!loss) return loss;
  if (auto stepped = take_step(optimiser, *loss, where); !stepped) return propagate(stepped);
  return loss;
}

}  // namespace engine::diffusion
