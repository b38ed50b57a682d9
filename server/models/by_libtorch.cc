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
#include "engine/weights/adapter_file.h"
#include "engine/weights/checkpoint.h"
#include "server/models/lpips_folder.h"
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
/// How many times faster than on one thread networks are computed.
double faster_on(int threads) {
  if (threads <= 0) threads = std::max(1, int(std::thread::hardware_concurrency()));
  return std::pow(double(std::min(threads, most_threads)), thread_power);
}

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

diffusion::RepainterOptions options_of(const params::Params& params, const Wishes& wishes, int threads) {
  diffusion::RepainterOptions options;
  if (!wishes.prompt.empty()) options.prompt = wishes.prompt;
  options.negative_prompt = wishes.negative_prompt;
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
                                                                      const Wishes& wishes) const {
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
  if (!wishes.lora.empty()) {
    const auto lora = loras_.find(wishes.lora);
    if (lora == loras_.end()) return fail(ErrorCode::unsupported, "there is no such adapter", "lora");
    const auto adapter = engine::weights::read_adapter(lora->second.file, model->configs());
    if (!adapter) return propagate(adapter);
    auto adapted = model->with(*adapter);
    if (!adapted) return propagate(adapted);
    model = std::move(*adapted);
  }
  auto made = diffusion::StableDiffusionRepainter::create(std::move(*model), options_of(params, wishes, threads_));
  if (!made) return about_parameter(made.error());
  return std::unique_ptr<engine::correct::Repainter>(std::move(*made));
}

RepainterCost Models::cost(const params::Params& params, const std::string& lora) const {
  if (!no_sd_.empty()) return {};
  const auto checkpoint = engine::weights::Checkpoint::open(checkpoint_);
  if (!checkpoint) return {};  // it was there when it was looked at; making the repainter will say what is wrong
  const diffusion::RepainterOptions options = options_of(params, {}, threads_);
  const auto one_thread = diffusion::seconds_of(checkpoint->configs(), options);
  const auto bytes = diffusion::bytes_of(checkpoint->configs(), options);
  const double faster = faster_on(threads_);
  const auto adapter = loras_.find(lora);
  const std::uint64_t adapter_bytes = adapter == loras_.end() ? 0 : adapter->second.bytes;
  // What it adds to a layer's output goes with its numbers, as the layer's own does.
  const double more = 1 + double(adapter_bytes) / double(bytes.networks);
  return {one_thread.training_step / faster,
          one_thread.picture / faster,
          more * one_thread.full_strength / faster,
          bytes.networks + adapter_bytes,
          bytes.painting,
          bytes.learning};
}

Result<std::unique_ptr<engine::optim::PerceptualLoss>> Models::lpips() const {
  if (!no_lpips_.empty()) return fail(ErrorCode::unsupported, no_lpips_, "params.perceptual");
  const auto files = open_lpips(folder_);
  if (!files) return propagate(files);
  auto made = diffusion::Lpips::create(*files, threads_);
  if (!made) return propagate(made);
  return std::unique_ptr<engine::optim::PerceptualLoss>(std::move(*made));
}

PerceptualCost Models::lpips_cost() const {
  if (!no_lpips_.empty()) return {};
  return {diffusion::lpips_pixel_seconds / faster_on(threads_), diffusion::lpips_network_bytes,
          diffusion::lpips_pixel_bytes};
}

}  // namespace server::models
