#include "engine/diffusion/stable_diffusion.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/empty.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "engine/core/finite.h"
#include "engine/core/rng.h"
#include "engine/diffusion/autoencoder.h"
#include "engine/diffusion/going.h"
#include "engine/diffusion/guard.h"
#include "engine/diffusion/img2img.h"
#include "engine/diffusion/networks.h"
#include "engine/diffusion/pictures.h"
#include "engine/diffusion/text_encoder.h"
#include "engine/weights/checkpoint.h"

namespace engine::diffusion {
namespace {

/// Streams of random numbers, of a picture's seed.
enum class Stream : std::uint64_t { latents, first_noise, later_noise };

void fill_normal(std::span<float> values, std::uint64_t seed, Stream stream, std::uint64_t call = 0) {
  Rng rng(seed, std::uint64_t(stream) + call);
  diffusion::fill_normal(values, rng);
}

}  // namespace

Result<Tensor> StableDiffusion::Networks::context_of(const std::string& prompt, const char* name,
                                                     const std::vector<Adapter>& adapters) const {
  auto pieces = tokenizer.encode(prompt, std::size_t(configs.text_encoder.positions));
  if (!pieces) return fail(pieces.error().code, std::move(pieces.error().message), name);
  Tensor numbers = at::empty({1, std::int64_t(pieces->size())}, at::kLong);
  std::ranges::copy(*pieces, numbers.data_ptr<std::int64_t>());
  return encode_text({text_encoder, adapters}, configs.text_encoder, numbers);
}

/// Of both networks.
struct StableDiffusion::Adapters {
  std::vector<Adapter> unet, text_encoder;
};

Result<StableDiffusion> StableDiffusion::open(const std::filesystem::path& path) {
  const auto checkpoint = weights::Checkpoint::open(path);
  if (!checkpoint) return propagate(checkpoint);
  auto vocabulary = weights::read_vocabulary(checkpoint->tokenizer_folder(), checkpoint->is_open_clip(),
                                             checkpoint->configs().text_encoder.vocabulary);
  if (!vocabulary) return propagate(vocabulary);
  auto unet = Parameters::load(*checkpoint, weights::Network::unet);
  if (!unet) return propagate(unet);
  auto autoencoder = Parameters::load(*checkpoint, weights::Network::autoencoder);
  if (!autoencoder) return propagate(autoencoder);
  auto text_encoder = Parameters::load(*checkpoint, weights::Network::text_encoder);
  if (!text_encoder) return propagate(text_encoder);
  const auto of_tensors = checkpoint->digest();
  if (!of_tensors) return propagate(of_tensors);
  StableDiffusion opened;
  opened.digest_ = *of_tensors + vocabulary->digest;
  opened.networks_ = std::make_shared<const Networks>(
      Networks{checkpoint->configs(), Tokenizer(std::move(*vocabulary)), *unet, *autoencoder, *text_encoder});
  opened.staying_ = opened.adapters_ = std::make_shared<const Adapters>();
  return opened;
}

Result<StableDiffusion> StableDiffusion::with(const weights::AdapterWeights& weights) const {
  StableDiffusion adapted = *this;
  if (const auto put = adapted.adapt(weights); !put) return propagate(put);
  adapted.staying_ = adapted.adapters_;
  adapted.digest_ += weights::digest_of(weights);
  return adapted;
}

Result<void> StableDiffusion::adapt(const weights::AdapterWeights& weights, double factor) {
  if (!std::isfinite(factor)) return fail(ErrorCode::invalid_argument, "expected a finite number", "factor");
  if (const auto checked = weights::check_adapter(weights, networks_->configs); !checked) return propagate(checked);
  return guarded("adapter", [&]() -> Result<void> {
    auto adapters = std::make_shared<Adapters>(*staying_);
    if (!weights.unet.empty()) adapters->unet.emplace_back(weights.unet).scale_by(factor);
    if (!weights.text_encoder.empty()) adapters->text_encoder.emplace_back(weights.text_encoder).scale_by(factor);
    adapters_ = std::move(adapters);
    return {};
  });
}

int StableDiffusion::side_multiple() const { return weights::side_multiple(networks_->configs); }

const weights::Configs& StableDiffusion::configs() const { return networks_->configs; }

Result<void> validate(const RepaintOptions& options, const weights::NoiseConfig& noise) {
  if (!(options.guidance >= 1 && options.guidance <= 100))
    return fail(ErrorCode::invalid_argument, "expected 1 to 100", "guidance");
  return validate(options.sampling, noise);
}

Result<void> StableDiffusion::check(const scene::Image& picture) const {
  const int multiple = side_multiple();
  if (picture.channels != 3 || picture.width < 1 || picture.height < 1 || picture.width % multiple != 0 ||
      picture.height % multiple != 0)
    return fail(ErrorCode::invalid_argument,
                "expected a picture of three channels with sides that are multiples of " + std::to_string(multiple),
                "picture");
  if (std::int64_t{picture.width} * picture.height > max_repaint_pixels)
    return fail(ErrorCode::too_large,
                "a picture of " + std::to_string(picture.width) + " x " + std::to_string(picture.height) +
                    " pixels; at most " + std::to_string(max_repaint_pixels) + " are repainted",
                "picture");
  if (const auto at = first_not_finite(picture.data))
    return fail(ErrorCode::invalid_argument, "not a finite number", "picture[" + std::to_string(*at) + "]");
  return {};
}

Result<scene::Image> StableDiffusion::through_autoencoder(const scene::Image& picture) const {
  if (const auto checked = check(picture); !checked) return propagate(checked);
  return guarded("repaint", [&]() -> Result<scene::Image> {
    const at::NoGradGuard no_gradients;
    const Model autoencoder{.parameters = networks_->autoencoder};
    return as_picture(there_and_back(autoencoder, networks_->configs.autoencoder, as_tensor(picture)));
  });
}

Result<scene::Image> StableDiffusion::repaint(const scene::Image& picture, const RepaintOptions& options,
                                              const Advance& advance) const {
  const weights::Configs& all = networks_->configs;
  if (const auto checked = check(picture); !checked) return propagate(checked);
  if (const auto valid = validate(options, all.noise); !valid) return propagate(valid);

  return guarded("repaint", [&]() -> Result<scene::Image> {
    const at::NoGradGuard no_gradients;
    const auto scheduler = make_scheduler(all.noise, options.sampling);
    if (scheduler->timesteps().empty()) return picture;
    const auto negative = networks_->context_of(options.negative_prompt, "negative_prompt", adapters_->text_encoder);
    if (!negative) return propagate(negative);
    const auto positive = networks_->context_of(options.prompt, "prompt", adapters_->text_encoder);
    if (!positive) return propagate(positive);

    Going going(advance);
    const Model autoencoder{.parameters = networks_->autoencoder, .before_block = going.asked()};
    const Model unet{.parameters = networks_->unet, .adapters = adapters_->unet, .before_block = going.asked()};
    // Encoding and decoding take about as long as a call of the UNet does.
    const double calls = double(scheduler->timesteps().size()) + 2;
    const auto after = [&](double done) { return going.at(done / calls); };
    if (auto begun = after(0); !begun) return propagate(begun);
    const Tensor moments = encode_moments(autoencoder, all.autoencoder, as_tensor(picture));
    Tensor noise = at::empty({1, all.autoencoder.latent_channels, moments.size(2), moments.size(3)}, at::kFloat);
    fill_normal(numbers_of(noise), options.seed, Stream::latents);
    Tensor latents = sample_latents(all.autoencoder, moments, noise).contiguous();
    fill_normal(numbers_of(noise), options.seed, Stream::first_noise);
    scheduler->add_noise(numbers_of(latents), numbers_of(noise), scheduler->timesteps().front());
    std::uint64_t call = 0;
    const NoiseSource later = [&](std::span<float> into) {
      fill_normal(into, options.seed, Stream::later_noise, call++);
    };
    const auto done = denoise(unet, all.unet, *scheduler, latents, at::cat({*negative, *positive}), options.guidance,
                              later, [&](double part) { return after(1 + part * (calls - 2)); });
    if (!done) return propagate(done);
    if (auto painted = after(calls - 1); !painted) return propagate(painted);
    return as_picture(decode_latents(autoencoder, all.autoencoder, latents));
  });
}

}  // namespace engine::diffusion
