#include "engine/diffusion/pretraining.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/empty.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/core/atomic_file.h"
#include "engine/core/rng.h"
#include "engine/diffusion/autoencoder.h"
#include "engine/diffusion/guard.h"
#include "engine/diffusion/numbers.h"
#include "engine/diffusion/parameters.h"
#include "engine/diffusion/pictures.h"
#include "engine/diffusion/text_encoder.h"
#include "engine/diffusion/tokenizer.h"
#include "engine/diffusion/training.h"
#include "engine/weights/safetensors.h"
#include "engine/weights/vocabulary.h"

namespace engine::diffusion {
namespace {

using std::filesystem::path;
using weights::Network;

/// What is drawn for a step: purposes of a seed.
enum class Purpose : std::uint32_t { tensors, autoencoder, unet, judged };

bool ends_without_effect(const std::string& layer) {
  // What is added to what a block is given begins as nothing: a deep network then learns from its first step
  // (Goyal et al. 2017, "Accurate, large minibatch SGD", section 5.1; Ho et al. 2020 for these very layers).
  return layer.ends_with(".conv2") || layer.ends_with(".proj_out") || layer.ends_with(".to_out.0") ||
         layer == "conv_out";
}

/// Random numbers for a tensor: uniform, so that what comes out of a layer varies as much as what goes in (LeCun et al.
/// 1998, "Efficient backprop", section 4.6); biases are zero, and norms begin as no change.
weights::FloatTensor fresh(const weights::TensorSpec& spec, Rng rng) {
  const std::size_t dot = spec.name.rfind('.');
  const std::string layer = spec.name.substr(0, dot), part = spec.name.substr(dot + 1);
  std::size_t count = 1, fan_in = 1;
  for (std::size_t i = 0; i < spec.shape.size(); ++i) {
    count *= std::size_t(spec.shape[i]);
    if (i > 0) fan_in *= std::size_t(spec.shape[i]);
  }
  weights::FloatTensor tensor{spec.shape, std::vector<float>(count, 0.0f)};
  if (layer.substr(layer.rfind('.') + 1).find("norm") != std::string::npos) {
    if (part == "weight") std::ranges::fill(tensor.values, 1.0f);
  } else if (layer.ends_with("_embedding") && spec.name.starts_with("text_model.")) {
    fill_normal(tensor.values, rng);
  } else if (part == "weight" && !ends_without_effect(layer)) {
    const float most = float(std::sqrt(3.0 / double(fan_in)));
    for (float& value : tensor.values) value = rng.uniform(-most, most);
  }
  return tensor;
}

std::string list_of(const std::vector<int>& numbers) {
  std::string text;
  for (const int number : numbers) text += (text.empty() ? "[" : ",") + std::to_string(number);
  return text + "]";
}

std::string names_of(std::size_t count, const std::function<std::string(std::size_t)>& name) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i) text += (text.empty() ? "[\"" : ",\"") + name(i) + "\"";
  return text + "]";
}

std::string number_of(double value) {
  std::array<char, 32> text{};
  return {text.data(), std::size_t(std::snprintf(text.data(), text.size(), "%.17g", value))};
}

std::string json_of(const weights::UNetConfig& config) {
  const auto block = [](bool attends, const char* way) {
    return (attends ? "CrossAttn" : "") + std::string(way) + "Block2D";
  };
  const std::size_t levels = config.channels.size();
  return "{\"_class_name\":\"UNet2DConditionModel\",\"in_channels\":4,\"out_channels\":4,\"block_out_channels\":" +
         list_of(config.channels) + ",\"attention_head_dim\":" + list_of(config.heads) +
         ",\"down_block_types\":" + names_of(levels, [&](auto i) { return block(config.down_attends[i], "Down"); }) +
         ",\"up_block_types\":" + names_of(levels, [&](auto i) { return block(config.up_attends[i], "Up"); }) +
         ",\"layers_per_block\":" + std::to_string(config.layers_per_block) +
         ",\"cross_attention_dim\":" + std::to_string(config.context_width) +
         ",\"norm_num_groups\":" + std::to_string(config.norm_groups) + ",\"norm_eps\":" + number_of(config.norm_eps) +
         ",\"use_linear_projection\":" + (config.linear_projection ? "true" : "false") +
         ",\"sample_size\":" + std::to_string(config.sample_side) + "}\n";
}

std::string json_of(const weights::AutoencoderConfig& config) {
  const std::size_t levels = config.channels.size();
  return "{\"_class_name\":\"AutoencoderKL\",\"in_channels\":3,\"out_channels\":3,\"latent_channels\":4,"
         "\"block_out_channels\":" +
         list_of(config.channels) +
         ",\"down_block_types\":" + names_of(levels, [](auto) { return "DownEncoderBlock2D"; }) +
         ",\"up_block_types\":" + names_of(levels, [](auto) { return "UpDecoderBlock2D"; }) +
         ",\"layers_per_block\":" + std::to_string(config.layers_per_block) +
         ",\"norm_num_groups\":" + std::to_string(config.norm_groups) +
         ",\"scaling_factor\":" + number_of(config.scaling_factor) + "}\n";
}

std::string json_of(const weights::TextEncoderConfig& config) {
  return "{\"model_type\":\"clip_text_model\",\"hidden_size\":" + std::to_string(config.width) +
         ",\"intermediate_size\":" + std::to_string(config.feed_forward_width) +
         ",\"num_hidden_layers\":" + std::to_string(config.layers) +
         ",\"num_attention_heads\":" + std::to_string(config.heads) +
         ",\"max_position_embeddings\":" + std::to_string(config.positions) +
         ",\"vocab_size\":" + std::to_string(config.vocabulary) + ",\"layer_norm_eps\":" + number_of(config.norm_eps) +
         ",\"hidden_act\":\"" + (config.activation == weights::Activation::gelu ? "gelu" : "quick_gelu") + "\"}\n";
}

std::string json_of(const weights::NoiseConfig& config) {
  return "{\"_class_name\":\"PNDMScheduler\",\"beta_schedule\":\"scaled_linear\",\"prediction_type\":\"epsilon\","
         "\"num_train_timesteps\":" +
         std::to_string(config.training_steps) + ",\"beta_start\":" + number_of(config.beta_start) +
         ",\"beta_end\":" + number_of(config.beta_end) + ",\"steps_offset\":" + std::to_string(config.steps_offset) +
         ",\"set_alpha_to_one\":" + (config.ends_without_noise ? "true" : "false") + "}\n";
}

std::string json_of(const weights::Vocabulary& vocabulary) {
  std::map<int, std::string> pieces;  // in order: the same bytes every time
  for (const auto& [piece, number] : vocabulary.numbers) pieces.emplace(number, piece);
  std::string text;
  for (const auto& [number, piece] : pieces) {
    text += text.empty() ? "{\"" : ",\"";
    for (const char c : piece) text += c == '"' || c == '\\' ? std::string("\\") + c : std::string(1, c);
    text += "\":" + std::to_string(number);
  }
  return text + "}\n";
}

Tensor batch_of(std::span<const scene::Image> pictures) {
  assert(!pictures.empty());
  std::vector<Tensor> tensors;
  for (const scene::Image& picture : pictures) tensors.push_back(as_tensor(picture));
  return at::cat(tensors);
}

}  // namespace

struct Pretraining::State {
  weights::Configs configs;
  PretrainingOptions options;
  weights::Vocabulary vocabulary;
  std::map<Network, std::map<std::string, Tensor>> tensors;
  Model autoencoder, unet;
  AdamW autoencoder_optimiser, unet_optimiser;
  Tensor without_prompt, with_prompt;  ///< [1, positions, width]
  std::uint64_t autoencoder_steps = 0, unet_steps = 0;

  State(const weights::Configs& of, const PretrainingOptions& with, weights::Vocabulary known,
        std::map<Network, std::map<std::string, Tensor>> made)
      : configs(of),
        options(with),
        vocabulary(std::move(known)),
        tensors(std::move(made)),
        autoencoder{.parameters = Parameters(tensors.at(Network::autoencoder))},
        // At this size transformers are kept: to compute them again would be slower, and memory is not short.
        unet{.parameters = Parameters(tensors.at(Network::unet)), .recomputes = false},
        autoencoder_optimiser(trained(Network::autoencoder), {.weight_decay = with.weight_decay}),
        unet_optimiser(trained(Network::unet), {.weight_decay = with.weight_decay}) {}

  [[nodiscard]] std::vector<Tensor> trained(Network network) const {
    std::vector<Tensor> all;
    for (const auto& [name, tensor] : tensors.at(network)) all.push_back(tensor);
    return all;
  }

  [[nodiscard]] Rng random(Purpose purpose, std::uint64_t step) const {
    return Rng(derived_seed(options.seed, {std::uint32_t(purpose), std::uint32_t(step), std::uint32_t(step >> 32), 0}));
  }

  /// What a picture's loss is computed from.
  struct Drawn {
    Tensor latents, noise, timesteps, context;
  };
  [[nodiscard]] Drawn drawn(std::span<const scene::Image> pictures, Rng rng) const {
    const at::NoGradGuard no_gradients;
    const Tensor moments = encode_moments(autoencoder, configs.autoencoder, batch_of(pictures));
    const Tensor latents = sample_latents(configs.autoencoder, moments, rng);
    const Tensor noise = normal_numbers(latents.sizes(), rng);
    const auto count = std::int64_t(pictures.size());
    Tensor timesteps = at::empty({count}, at::kLong);
    std::vector<Tensor> contexts;
    for (std::int64_t i = 0; i < count; ++i) {
      // One in each of as many equal parts of the range: the loss varies less than with times that are free.
      const float part = (float(i) + rng.uniform()) / float(count);
      const int last = configs.noise.training_steps - 1;
      timesteps.data_ptr<std::int64_t>()[i] = std::min(int(part * float(configs.noise.training_steps)), last);
      // By chance, not in turns: then either guidance would be learned at some of the times alone.
      contexts.push_back(rng.below(2) == 0 ? with_prompt : without_prompt);
    }
    return {latents, noise, timesteps, at::cat(contexts)};
  }
};

Pretraining::Pretraining(std::unique_ptr<State> state) : state_(std::move(state)) {}
Pretraining::Pretraining(Pretraining&&) noexcept = default;
Pretraining& Pretraining::operator=(Pretraining&&) noexcept = default;
Pretraining::~Pretraining() = default;

const weights::Configs& Pretraining::configs() const { return state_->configs; }

Result<Pretraining> Pretraining::begin(const weights::Configs& configs, const PretrainingOptions& options) {
  if (auto valid = weights::validate(configs); !valid) return propagate(valid);
  weights::Vocabulary vocabulary = weights::clip_vocabulary({});
  if (configs.text_encoder.vocabulary < int(vocabulary.numbers.size()))
    return fail(ErrorCode::invalid_argument,
                "expected at least " + std::to_string(vocabulary.numbers.size()) + " pieces", "text_encoder");
  return guarded("pretraining", [&]() -> Result<Pretraining> {
    std::map<Network, std::map<std::string, Tensor>> tensors;
    std::uint64_t stream = 0;
    const std::uint64_t seed = derived_seed(options.seed, {std::uint32_t(Purpose::tensors), 0, 0, 0});
    for (const Network network : {Network::unet, Network::autoencoder, Network::text_encoder})
      for (const weights::TensorSpec& spec : weights::tensors_of(configs, network))
        tensors[network].emplace(spec.name, tensor_of(fresh(spec, Rng(seed, stream++))));
    auto state = std::make_unique<State>(configs, options, vocabulary, std::move(tensors));
    const Tokenizer tokenizer(std::move(vocabulary));
    const Model text_encoder{.parameters = Parameters(state->tensors.at(Network::text_encoder))};
    const at::NoGradGuard no_gradients;
    for (const auto& [prompt, context] :
         {std::pair{std::string(), &state->without_prompt}, {options.prompt, &state->with_prompt}}) {
      const auto pieces = tokenizer.encode(prompt, std::size_t(configs.text_encoder.positions));
      if (!pieces) return propagate(pieces);
      Tensor numbers = at::empty({1, std::int64_t(pieces->size())}, at::kLong);
      std::ranges::copy(*pieces, numbers.data_ptr<std::int64_t>());
      *context = encode_text(text_encoder, configs.text_encoder, numbers);
    }
    return Pretraining(std::move(state));
  });
}

Result<AutoencoderLoss> Pretraining::autoencoder_step(std::span<const scene::Image> pictures, double learning_rate) {
  AutoencoderLoss losses;
  const auto added = guarded("pretraining", [&]() -> Result<double> {
    const at::AutoGradMode gradients(true);
    state_->autoencoder_optimiser.clear_gradients();
    const weights::AutoencoderConfig& config = state_->configs.autoencoder;
    const Tensor shown = batch_of(pictures), moments = encode_moments(state_->autoencoder, config, shown);
    const Tensor mean = moments.narrow(1, 0, config.latent_channels),
                 log_variance = moments.narrow(1, config.latent_channels, config.latent_channels);
    Rng rng = state_->random(Purpose::autoencoder, state_->autoencoder_steps);
    const Tensor off = decode_latents(state_->autoencoder, config, sample_latents(config, moments, rng)) - shown;
    const Tensor absolute = off.abs().mean(), squares = off.pow(2).mean();
    const Tensor divergence = (mean.pow(2) + log_variance.exp() - log_variance - 1).mean() * 0.5;
    // Squares, whose gradients vanish where a picture is nearly right, are what PSNR asks for; absolutes sharpen edges.
    const Tensor loss = absolute + squares + divergence * state_->options.divergence_weight;
    losses = {absolute.item<double>(), squares.item<double>(), divergence.item<double>()};
    loss.backward();
    return loss.item<double>();
  });
  if (!added) return propagate(added);
  state_->autoencoder_optimiser.set_learning_rate(learning_rate);
  if (auto stepped = take_step(state_->autoencoder_optimiser, *added, "pretraining"); !stepped)
    return propagate(stepped);
  ++state_->autoencoder_steps;
  return losses;
}

Result<scene::Image> Pretraining::through_autoencoder(const scene::Image& picture) const {
  return guarded("pretraining", [&]() -> Result<scene::Image> {
    const at::NoGradGuard no_gradients;
    return as_picture(there_and_back(state_->autoencoder, state_->configs.autoencoder, as_tensor(picture)));
  });
}

Result<double> Pretraining::scale_latents(std::span<const scene::Image> pictures) {
  assert(!pictures.empty());
  return guarded("pretraining", [&]() -> Result<double> {
    const at::NoGradGuard no_gradients;
    weights::AutoencoderConfig& config = state_->configs.autoencoder;
    double sum = 0, squares = 0, count = 0;
    for (const scene::Image& picture : pictures) {
      const Tensor mean = encode_moments(state_->autoencoder, config, as_tensor(picture))
                              .narrow(1, 0, config.latent_channels)
                              .to(at::kDouble);
      sum += mean.sum().item<double>();
      squares += mean.pow(2).sum().item<double>();
      count += double(mean.numel());
    }
    const double variance = squares / count - (sum / count) * (sum / count);
    if (!std::isfinite(variance))
      return fail(ErrorCode::internal, "the latents of the pictures are not finite", "latents");
    if (!(variance > 1e-12)) return fail(ErrorCode::internal, "the latents of all pictures are the same", "latents");
    return config.scaling_factor = 1 / std::sqrt(variance);
  });
}

Result<double> Pretraining::unet_step(std::span<const scene::Image> pictures, double learning_rate) {
  state_->unet_optimiser.set_learning_rate(learning_rate);
  return guarded("pretraining", [&]() -> Result<double> {
    const State::Drawn drawn = state_->drawn(pictures, state_->random(Purpose::unet, state_->unet_steps));
    auto loss =
        training_step(state_->unet, state_->configs, {&drawn.latents, &drawn.noise, &drawn.timesteps, &drawn.context},
                      state_->unet_optimiser, "pretraining");
    if (loss) ++state_->unet_steps;
    return loss;
  });
}

Result<double> Pretraining::unet_loss(std::span<const scene::Image> pictures, std::uint64_t seed) const {
  return guarded("pretraining", [&]() -> Result<double> {
    const at::NoGradGuard no_gradients;
    const State::Drawn drawn = state_->drawn(pictures, state_->random(Purpose::judged, seed));
    return denoising_loss(state_->unet, state_->configs,
                          {&drawn.latents, &drawn.noise, &drawn.timesteps, &drawn.context})
        .item<double>();
  });
}

Result<void> Pretraining::write(const path& folder) const {
  return guarded("pretraining", [&]() -> Result<void> {
    const weights::Configs& configs = state_->configs;
    const auto tensors = [&](Network network) {
      std::map<std::string, weights::FloatTensor> values;
      for (const auto& [name, tensor] : state_->tensors.at(network)) values.emplace(name, values_of(tensor));
      return weights::encode_tensors(values);
    };
    const std::array<std::pair<const char*, std::string>, 9> files{
        {{"unet/config.json", json_of(configs.unet)},
         {"vae/config.json", json_of(configs.autoencoder)},
         {"text_encoder/config.json", json_of(configs.text_encoder)},
         {"scheduler/scheduler_config.json", json_of(configs.noise)},
         {"tokenizer/vocab.json", json_of(state_->vocabulary)},
         {"tokenizer/merges.txt", "#version: 0.2\n"},
         {"unet/diffusion_pytorch_model.safetensors", tensors(Network::unet)},
         {"vae/diffusion_pytorch_model.safetensors", tensors(Network::autoencoder)},
         {"text_encoder/model.safetensors", tensors(Network::text_encoder)}}};
    for (const auto& [name, bytes] : files) {
      const path file = folder / name;
      std::error_code failed;
      std::filesystem::create_directories(file.parent_path(), failed);
      if (failed) return fail(ErrorCode::unavailable, "cannot make the folder: " + failed.message(), name);
      if (auto written = write_file(file, std::as_bytes(std::span(bytes))); !written) return written;
    }
    return {};
  });
}

}  // namespace engine::diffusion
