// Samplers: which time steps are taken from noise to picture, and how a prediction of the noise leads from one to the
// next. Sources: Ho et al. 2020, "Denoising diffusion probabilistic models", eq. 4 (adding noise); Song et al. 2021,
// "Denoising diffusion implicit models", eqs. 12 and 16; Liu et al. 2022, "Pseudo numerical methods for diffusion
// models on manifolds", eqs. 11 and 12; Lu et al. 2022, "DPM-Solver++", algorithm 2; Karras et al. 2022, "Elucidating
// the design space of diffusion-based generative models", eq. 5; Luo et al. 2023, "Latent consistency models",
// section 4.3.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "engine/core/names.h"
#include "engine/core/result.h"
#include "engine/weights/networks.h"

namespace engine::diffusion {

enum class Sampler {
  ddim,
  pndm,     ///< As Stable Diffusion 1.x was published with: multistep, fourth order after four steps.
  dpmpp2m,  ///< DPM-Solver++ of second order, multistep.
  lcm       ///< Consistency: 2 to 8 steps, for networks that were distilled to it (LCM-LoRA).
};
constexpr auto names_of(Sampler) {
  return std::array{Name{Sampler::ddim, "ddim"}, Name{Sampler::pndm, "pndm"}, Name{Sampler::dpmpp2m, "dpmpp2m"},
                    Name{Sampler::lcm, "lcm"}};
}

/// How steps are spread over the steps of training. The names are those of the field; lcm has a way of its own.
enum class Spacing { leading, linspace, trailing };

struct SamplerOptions {
  Sampler sampler = Sampler::ddim;
  int steps = 50;       ///< 1 to half the steps of training, of strength 1. Less strength takes fewer.
  double strength = 1;  ///< 0 to 1: how noisy the first step is; 1 begins with noise alone.
  Spacing spacing = Spacing::leading;
  bool karras_sigmas = false;  ///< dpmpp2m: noise levels as in Karras et al., rho 7.
  double eta = 0;              ///< ddim: 0 to 1, how much noise is made anew at each step.
  int distilled_steps = 50;    ///< lcm: steps that the network was distilled to skip among.
};
/// errors  invalid_argument; `where` names the option, or "steps_offset": with the checkpoint's, leading spacing would
/// begin
///         beyond the last step of training
[[nodiscard]] Result<void> validate(const SamplerOptions& options, const weights::NoiseConfig& noise);

/// How much of the picture is left after t steps of noise: the product of 1 - beta, for each of the steps of training.
[[nodiscard]] std::vector<double> alphas_cumprod(const weights::NoiseConfig& noise);

/// One way from noise to picture; made anew for each picture. Computes in double, and stores latents as float.
class Scheduler {
 public:
  virtual ~Scheduler() = default;

  /// The time steps of the calls to come, in their order; none if strength times steps is below 1.
  [[nodiscard]] const std::vector<int>& timesteps() const { return timesteps_; }

  /// sqrt(alpha) x + sqrt(1 - alpha) noise, at any time step of training.
  void add_noise(std::span<float> latents, std::span<const float> noise, int timestep) const;

  /// Does step() look at the noise it is given?
  [[nodiscard]] virtual bool takes_noise() const { return false; }
  /// The next call: leads `latents` from their time step to the next one.
  ///   predicted  the noise that the network sees in them
  ///   noise      normal numbers, if takes_noise()
  /// Precondition: there is a time step left; all of one size.
  void step(std::span<float> latents, std::span<const float> predicted, std::span<const float> noise);

 protected:
  Scheduler(const weights::NoiseConfig& noise, const SamplerOptions& options);

  /// The call number `call_` (from 0): computes in place. `call_` is counted up after it.
  virtual void advance(std::span<float> latents, std::span<const float> predicted, std::span<const float> noise) = 0;
  /// Keeps of a list of `steps` time steps those that the strength leaves.
  void keep(std::vector<int> all, const SamplerOptions& options);
  /// alpha at a time step of training; before the first one, that of the first, or 1 if the checkpoint says so.
  [[nodiscard]] double alpha(int timestep) const;

  std::vector<double> alphas_;
  double last_alpha_;
  std::vector<int> timesteps_;
  std::size_t skipped_ = 0;  ///< Time steps of the whole list before the first that is kept.
  std::size_t call_ = 0;
};

/// Precondition: validate(options, noise).
[[nodiscard]] std::unique_ptr<Scheduler> make_scheduler(const weights::NoiseConfig& noise,
                                                        const SamplerOptions& options);

}  // namespace engine::diffusion
