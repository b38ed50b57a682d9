// What edits use of the models, where libtorch is there to compute them.
#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "engine/diffusion/lpips.h"
#include "engine/diffusion/repainter.h"
#include "engine/diffusion/stable_diffusion.h"
#include "engine/weights/checkpoint.h"
#include "server/models/models.h"

namespace server::models {

namespace diffusion = engine::diffusion;
namespace params = engine::params;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;

namespace {

// So much faster networks are computed by n threads: n to this power. A guess; beyond eight nobody counts on more.
constexpr double thread_power = 0.7;
constexpr int most_threads = 8;
// What networks compute takes beside them, at the size of 1.5: docs/stable-diffusion.md.
constexpr std::uint64_t computing_bytes = std::uint64_t{1} << 30;

diffusion::Sampler sampler_of(params::Sampler sampler) {
  switch (sampler) {
    case params::Sampler::ddim:
      return diffusion::Sampler::ddim;
    case params::Sampler::pndm:
      return diffusion::Sampler::pndm;
    case params::Sampler::dpmpp2m:
      return diffusion::Sampler::dpmpp2m;
    case params::Sampler::lcm:
      return diffusion::Sampler::lcm;
  }
  return diffusion::Sampler::dpmpp2m;
}

diffusion::RepainterOptions options_of(const params::Params& params, const Prompts& prompts, int threads) {
  diffusion::RepainterOptions options;
  if (!prompts.prompt.empty()) options.prompt = prompts.prompt;
  options.negative_prompt = prompts.negative;
  options.guidance = params.guidance;
  options.sampling.sampler = sampler_of(params.sampler);
  options.sampling.steps = params.sampling_steps;
  options.rank = params.lora_rank;
  options.threads = threads;
  return options;
}

/// An error about an option of the repainter, as one about the parameter that it came from.
tl::unexpected<engine::Error> about_parameter(engine::Error error) {
  for (const auto& [option, parameter] : {std::pair{"guidance", "params.guidance"},
                                          {"steps", "params.sampling_steps"},
                                          {"rank", "params.lora_rank"},
                                          {"sampler", "params.sampler"}})
    if (error.where == option) error.where = parameter;
  return tl::make_unexpected(std::move(error));
}

}  // namespace

struct Models::Loaded {
  std::mutex mutex;  ///< Of what follows; held while a checkpoint is opened, which others then wait for.
  std::optional<diffusion::StableDiffusion> sd;
};

bool Models::has_libtorch() { return true; }
std::shared_ptr<Models::Loaded> Models::nothing_loaded() { return std::make_shared<Loaded>(); }

Result<std::unique_ptr<engine::correct::Repainter>> Models::repainter(const params::Params& params,
                                                                      const Prompts& prompts) const {
  if (!no_sd_.empty()) return fail(ErrorCode::unsupported, no_sd_, "params.corrector");
  std::optional<diffusion::StableDiffusion> model;
  {
    const std::lock_guard hold(loaded_->mutex);
    if (!loaded_->sd) {
      auto opened = diffusion::StableDiffusion::open(checkpoint_);
      if (!opened) return propagate(opened);
      loaded_->sd.emplace(std::move(*opened));
    }
    model = loaded_->sd;
  }
  auto made = diffusion::StableDiffusionRepainter::create(std::move(*model), options_of(params, prompts, threads_));
  if (!made) return about_parameter(made.error());
  return std::unique_ptr<engine::correct::Repainter>(std::move(*made));
}

RepainterCost Models::cost(const params::Params& params) const {
  if (!no_sd_.empty()) return {};
  const auto checkpoint = engine::weights::Checkpoint::open(checkpoint_);
  if (!checkpoint) return {};  // it was there when it was looked at; making the repainter will say what is wrong
  const auto one_thread = diffusion::seconds_of(checkpoint->configs(), options_of(params, {}, threads_));
  const int threads = threads_ > 0 ? threads_ : std::max(1, int(std::thread::hardware_concurrency()));
  const double faster = std::pow(double(std::min(threads, most_threads)), thread_power);
  return {one_thread.training_step / faster, one_thread.picture / faster, one_thread.full_strength / faster,
          checkpoint_bytes_ + computing_bytes};
}

Result<std::unique_ptr<engine::optim::PerceptualLoss>> Models::lpips() const {
  if (!no_lpips_.empty()) return fail(ErrorCode::unsupported, no_lpips_, "params.perceptual");
  auto opened =
      diffusion::Lpips::open(folder_ / "lpips" / "vgg16.safetensors", folder_ / "lpips" / "vgg_v0.1.safetensors");
  if (!opened) return propagate(opened);
  return std::unique_ptr<engine::optim::PerceptualLoss>(std::move(*opened));
}

}  // namespace server::models
