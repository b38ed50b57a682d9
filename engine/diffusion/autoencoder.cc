#include "engine/diffusion/autoencoder.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/constant_pad_nd.h>
#include <ATen/ops/silu.h>

#include <array>
#include <utility>
#include <vector>

#include "engine/diffusion/pictures.h"

namespace engine::diffusion {
namespace {

constexpr double norm_eps = 1e-6;

/// One head over all places of the coarsest level.
Tensor attend(const Layer& layer, const Tensor& x, int groups) {
  layer.begin_block();
  const Tensor tokens = group_norm(layer / "group_norm", x, groups, norm_eps).flatten(2).transpose(1, 2);
  const Tensor out =
      attention(linear(layer / "to_q", tokens), linear(layer / "to_k", tokens), linear(layer / "to_v", tokens), 1, {});
  return layer.shown(linear(layer / "to_out.0", out).transpose(1, 2).reshape(x.sizes()) + x);
}

Tensor middle(const Layer& block, const Tensor& x, int groups) {
  Tensor hidden = resnet(block / "resnets.0", x, nullptr, groups, norm_eps);
  hidden = attend(block / "attentions.0", hidden, groups);
  return block.shown(resnet(block / "resnets.1", hidden, nullptr, groups, norm_eps));
}

Tensor finish(const Layer& half, const Tensor& x, int groups) {
  return convolution(half / "conv_out", at::silu(group_norm(half / "conv_norm_out", x, groups, norm_eps)));
}

}  // namespace

Tensor encode_moments(const Model& model, const weights::AutoencoderConfig& config, const Tensor& picture) {
  const Layer root(model), encoder = root / "encoder";
  Tensor hidden = convolution(encoder / "conv_in", picture);
  for (int level = 0; level < int(config.channels.size()); ++level) {
    const Layer block = encoder / "down_blocks" / level;
    for (int i = 0; i < config.layers_per_block; ++i)
      hidden = resnet(block / "resnets" / i, hidden, nullptr, config.norm_groups, norm_eps);
    if (level + 1 < int(config.channels.size())) {
      // One row and one column of zeros, below and to the right only.
      const std::array<std::int64_t, 4> border{0, 1, 0, 1};
      hidden = convolution(block / "downsamplers.0.conv", at::constant_pad_nd(hidden, border), 2, 0);
    }
    hidden = block.shown(std::move(hidden));
  }
  hidden = finish(encoder, middle(encoder / "mid_block", hidden, config.norm_groups), config.norm_groups);
  const std::vector<Tensor> moments = convolution(root / "quant_conv", hidden, 1, 0).chunk(2, 1);
  return at::cat({moments[0], moments[1].clamp(-30, 20)}, 1);
}

Tensor sample_latents(const weights::AutoencoderConfig& config, const Tensor& moments, const Tensor& noise) {
  const std::vector<Tensor> parts = moments.chunk(2, 1);
  return (parts[0] + (parts[1] * 0.5).exp() * noise) * config.scaling_factor;
}

Tensor sample_latents(const weights::AutoencoderConfig& config, const Tensor& moments, Rng& rng) {
  // A tensor of its own: means cut out of the moments of one picture are contiguous, and would be written over.
  const std::array<std::int64_t, 4> shape{moments.size(0), config.latent_channels, moments.size(2), moments.size(3)};
  return sample_latents(config, moments, normal_numbers(shape, rng));
}

Tensor decode_latents(const Model& model, const weights::AutoencoderConfig& config, const Tensor& latents) {
  const Layer root(model), decoder = root / "decoder";
  Tensor hidden = convolution(root / "post_quant_conv", latents / config.scaling_factor, 1, 0);
  hidden = middle(decoder / "mid_block", convolution(decoder / "conv_in", hidden), config.norm_groups);
  const int levels = int(config.channels.size());
  for (int i = 0; i < levels; ++i) {
    const Layer block = decoder / "up_blocks" / i;
    for (int layer = 0; layer <= config.layers_per_block; ++layer)
      hidden = resnet(block / "resnets" / layer, hidden, nullptr, config.norm_groups, norm_eps);
    if (i + 1 < levels) hidden = upsample(block / "upsamplers.0", hidden);
    hidden = block.shown(std::move(hidden));
  }
  return finish(decoder, hidden, config.norm_groups);
}

Tensor there_and_back(const Model& model, const weights::AutoencoderConfig& config, const Tensor& pictures) {
  const Tensor means = encode_moments(model, config, pictures).narrow(1, 0, config.latent_channels);
  return decode_latents(model, config, means * config.scaling_factor);
}

}  // namespace engine::diffusion
