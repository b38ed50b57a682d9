#include "engine/diffusion/img2img.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/full.h>

#include <string>
#include <vector>

#include "engine/core/finite.h"
#include "engine/diffusion/unet.h"

namespace engine::diffusion {

Tensor guided_noise(const Model& unet, const weights::UNetConfig& config, const Tensor& latents, int timestep,
                    const Tensor& contexts, double guidance) {
  const bool guided = guidance != 1;
  const Tensor t = at::full({guided ? 2 : 1}, timestep, at::kLong);
  if (!guided) return predict_noise(unet, config, latents, t, contexts.narrow(0, 1, 1));
  const Tensor both = predict_noise(unet, config, at::cat({latents, latents}), t, contexts);
  const Tensor without = both.narrow(0, 0, 1), with = both.narrow(0, 1, 1);
  return without + (with - without) * guidance;
}

Result<void> denoise(const Model& unet, const weights::UNetConfig& config, Scheduler& scheduler, Tensor& latents,
                     const Tensor& contexts, double guidance, const NoiseSource& noise, const Advance& advance) {
  const auto count = std::size_t(latents.numel());
  std::vector<float> fresh(scheduler.takes_noise() ? count : 0);
  std::size_t done = 0;
  for (const int timestep : scheduler.timesteps()) {
    if (advance)
      if (auto going = advance(double(done++) / double(scheduler.timesteps().size())); !going) return going;
    const Tensor predicted = guided_noise(unet, config, latents, timestep, contexts, guidance).contiguous();
    if (!fresh.empty()) noise(fresh);
    scheduler.step({latents.data_ptr<float>(), count}, {predicted.data_ptr<float>(), count}, fresh);
    if (first_not_finite({latents.data_ptr<float>(), count}))
      return fail(ErrorCode::internal,
                  "what the networks see at time step " + std::to_string(timestep) + " is not finite", "latents");
  }
  return {};
}

}  // namespace engine::diffusion
