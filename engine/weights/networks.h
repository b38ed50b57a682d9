// The networks of Stable Diffusion 1.x and 2.x-base as data: what a configuration says, and which tensors, of which
// shapes, a network made from it has. Knows no arithmetic, so that files can be checked without any library for it.
// Source: Rombach et al. 2022, "High-resolution image synthesis with latent diffusion models"; names of tensors and
// fields as in the folders of Hugging Face's diffusers and transformers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/weights/safetensors.h"

namespace engine::weights {

enum class Network { unet, autoencoder, text_encoder };

/// unet/config.json. The defaults are those of Stable Diffusion 1.5.
struct UNetConfig {
  int in_channels = 4, out_channels = 4;
  std::vector<int> channels = {320, 640, 1280, 1280};  ///< Of each level, finest first.
  std::vector<int> heads = {8, 8, 8, 8};               ///< Of each level's attention.
  std::vector<bool> down_attends = {true, true, true, false};
  std::vector<bool> up_attends = {false, true, true, true};  ///< Coarsest level first.
  int layers_per_block = 2;
  int context_width = 768;  ///< Of a token's encoding.
  int norm_groups = 32;
  double norm_eps = 1e-5;
  bool linear_projection = false;  ///< Transformers project by matrices (2.x) or by 1 x 1 convolutions.
  int sample_side = 64;            ///< Latents along a side of the pictures that it was trained on. No tensor tells.

  [[nodiscard]] int embedding_width() const { return 4 * channels.front(); }
};

/// vae/config.json. The defaults are those of Stable Diffusion 1.5.
struct AutoencoderConfig {
  int image_channels = 3, latent_channels = 4;
  std::vector<int> channels = {128, 256, 512, 512};
  int layers_per_block = 2;
  int norm_groups = 32;
  double scaling_factor = 0.18215;  ///< Latents are multiplied by it: about unit variance.

  /// Pixels that one latent stands for, along a side.
  [[nodiscard]] int pixels_per_latent() const { return 1 << (channels.size() - 1); }
};

enum class Activation { quick_gelu, gelu };

/// text_encoder/config.json. The defaults are those of Stable Diffusion 1.5.
struct TextEncoderConfig {
  int width = 768, feed_forward_width = 3072;
  int layers = 12, heads = 12;
  int positions = 77, vocabulary = 49408;
  double norm_eps = 1e-5;
  Activation activation = Activation::quick_gelu;
};

/// scheduler/scheduler_config.json: how noise was added in training. Between the first step and the last, a billionth
/// of the noise, and of the picture, is left at least.
struct NoiseConfig {
  int training_steps = 1000;
  double beta_start = 0.00085, beta_end = 0.012;  ///< Square roots of betas are equidistant ("scaled_linear").
  int steps_offset = 1;
  bool ends_without_noise = false;  ///< Do DDIM and PNDM end at no noise ("set_alpha_to_one"), or at the first step's?
};

struct Configs {
  UNetConfig unet;
  AutoencoderConfig autoencoder;
  TextEncoderConfig text_encoder;
  NoiseConfig noise;
};

/// Pixels along a side of the largest picture that networks are shown: twice that of 1.x and 2.x-base. Beyond, their
/// memory would have no bound that is known.
constexpr int max_picture_side = 1 << 10;

/// Sides of pictures are multiples of this: 64 for 1.x and 2.x. Each level of either network halves them once more.
[[nodiscard]] int side_multiple(const Configs& configs);

/// Pixels along the longer side of pictures as networks are shown them: the multiple of side_multiple() nearest to what
/// the UNet was trained on, at least one. 512 for 1.x and 2.x-base.
[[nodiscard]] int picture_side(const Configs& configs);

/// Do networks of these configurations fit each other, and what they are shown into max_picture_side?
///   errors  corrupt_data, unsupported; `where` is the field
[[nodiscard]] Result<void> validate(const Configs& configs);

/// Those of Stable Diffusion 1.x, and of 2.x-base, for files that have none beside them.
[[nodiscard]] Configs stable_diffusion_1();
[[nodiscard]] Configs stable_diffusion_2_base();

/// From the text of a config.json. What is absent is as the field's libraries have it, but for beta_schedule,
/// beta_start and beta_end, which must be there: what the libraries would take for them is no Stable Diffusion.
///   file    for errors: "unet/config.json"
///   errors  corrupt_data: no JSON, a field of the wrong type or size; unsupported: a network of another kind (`where`
///           names the field that makes it one, such as SDXL's addition_embed_type)
[[nodiscard]] Result<UNetConfig> parse_unet_config(std::span<const std::byte> json, const std::string& file);
[[nodiscard]] Result<AutoencoderConfig> parse_autoencoder_config(std::span<const std::byte> json,
                                                                 const std::string& file);
[[nodiscard]] Result<TextEncoderConfig> parse_text_encoder_config(std::span<const std::byte> json,
                                                                  const std::string& file);
[[nodiscard]] Result<NoiseConfig> parse_noise_config(std::span<const std::byte> json, const std::string& file);

/// A tensor that a network needs.
struct TensorSpec {
  std::string name;  ///< As in a folder of diffusers, its current names: "conv_in.weight".
  Shape shape;
};

/// All tensors of a network, each once. Nothing is allocated but the list.
[[nodiscard]] std::vector<TensorSpec> tensors_of(const UNetConfig& config);
[[nodiscard]] std::vector<TensorSpec> tensors_of(const AutoencoderConfig& config);
[[nodiscard]] std::vector<TensorSpec> tensors_of(const TextEncoderConfig& config);
[[nodiscard]] std::vector<TensorSpec> tensors_of(const Configs& configs, Network network);

}  // namespace engine::weights
