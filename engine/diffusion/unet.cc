#include "engine/diffusion/unet.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/ops/arange.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/gelu.h>
#include <ATen/ops/silu.h>

#include <cmath>
#include <utility>
#include <vector>

#include "engine/diffusion/recompute.h"

namespace engine::diffusion {
namespace {

constexpr double transformer_norm_eps = 1e-6, layer_norm_eps = 1e-5;

/// Cosines, then sines, of the time step at `width` / 2 frequencies from 1 down to 1 / 10000.
Tensor time_waves(const Tensor& timesteps, int width) {
  const int half = width / 2;
  const Tensor frequencies =
      (at::arange(half, timesteps.options().dtype(at::kFloat)) * (-std::log(10000.0) / half)).exp();
  const Tensor angles = timesteps.to(at::kFloat).unsqueeze(1) * frequencies.unsqueeze(0);
  return at::cat({angles.cos(), angles.sin()}, 1);
}

Tensor attend(const Layer& layer, const Tensor& x, const Tensor& context, int heads) {
  const Tensor out =
      attention(linear(layer / "to_q", x), linear(layer / "to_k", context), linear(layer / "to_v", context), heads, {});
  return layer.shown(linear(layer / "to_out.0", out));
}

/// Half of a matrix's output, gated by GELU of the other half, and a matrix (Shazeer 2020, "GLU variants").
Tensor feed_forward(const Layer& layer, const Tensor& x) {
  const std::vector<Tensor> halves = linear(layer / "net.0.proj", x).chunk(2, -1);
  const Tensor gated = (layer / "net.0").shown(halves[0] * at::gelu(halves[1]));
  return layer.shown(linear(layer / "net.2", gated));
}

Tensor transformer(const Layer& layer, const Tensor& x, const Tensor& context, int heads,
                   const weights::UNetConfig& config) {
  layer.begin_block();
  const std::int64_t batch = x.size(0), width = x.size(1), height = x.size(2), breadth = x.size(3);
  const auto as_tokens = [&](const Tensor& picture) { return picture.reshape({batch, width, -1}).transpose(1, 2); };
  const auto as_picture = [&](const Tensor& tokens) {
    return tokens.transpose(1, 2).reshape({batch, width, height, breadth});
  };
  Tensor hidden = group_norm(layer / "norm", x, config.norm_groups, transformer_norm_eps);
  hidden = config.linear_projection ? linear(layer / "proj_in", as_tokens(hidden))
                                    : as_tokens(convolution(layer / "proj_in", hidden, 1, 0));
  const Layer block = layer / "transformer_blocks.0";
  const Tensor first = layer_norm(block / "norm1", hidden, layer_norm_eps);
  hidden = hidden + attend(block / "attn1", first, first, heads);
  hidden = hidden + attend(block / "attn2", layer_norm(block / "norm2", hidden, layer_norm_eps), context, heads);
  hidden = hidden + feed_forward(block / "ff", layer_norm(block / "norm3", hidden, layer_norm_eps));
  hidden = config.linear_projection ? as_picture(linear(layer / "proj_out", hidden))
                                    : convolution(layer / "proj_out", as_picture(hidden), 1, 0);
  return layer.shown(hidden + x);
}

/// One call of the network: what all its blocks are given.
class Call {
 public:
  Call(const Model& model, const weights::UNetConfig& config, const Tensor& timesteps, const Tensor& context)
      : root_(model), config_(config), context_(context) {
    const Layer embedding = root_ / "time_embedding";
    const Tensor waves = (root_ / "time_proj").shown(time_waves(timesteps, config.channels.front()));
    embedding_ = embedding.shown(linear(embedding / "linear_2", at::silu(linear(embedding / "linear_1", waves))));
  }

  Tensor run(const Tensor& latents) {
    const int levels = int(config_.channels.size());
    Tensor hidden = convolution(root_ / "conv_in", latents);
    left_.push_back(hidden);
    for (int level = 0; level < levels; ++level) hidden = down(level, std::move(hidden));
    hidden = middle(hidden);
    for (int i = 0; i < levels; ++i) hidden = up(i, std::move(hidden));
    hidden = group_norm(root_ / "conv_norm_out", hidden, config_.norm_groups, config_.norm_eps);
    return convolution(root_ / "conv_out", at::silu(hidden));
  }

 private:
  Tensor resnet_of(const Layer& layer, const Tensor& x) const {
    return resnet(layer, x, &embedding_, config_.norm_groups, config_.norm_eps);
  }

  /// Most of what a step of training would keep is what transformers compute: at 512 x 512 pixels the products of five
  /// of them take 2.7 GB.
  Tensor transformer_of(const Layer& layer, const Tensor& x, std::size_t level) const {
    const Part part = [layer, heads = config_.heads[level], &config = config_](const Tensor& in,
                                                                               const Tensor& context) {
      return transformer(layer, in, context, heads, config);
    };
    return layer.recomputes() ? recomputed(part, x, context_) : part(x, context_);
  }

  Tensor down(int level, Tensor hidden) {
    const Layer block = root_ / "down_blocks" / level;
    for (int i = 0; i < config_.layers_per_block; ++i) {
      hidden = resnet_of(block / "resnets" / i, hidden);
      if (config_.down_attends[std::size_t(level)])
        hidden = transformer_of(block / "attentions" / i, hidden, std::size_t(level));
      left_.push_back(hidden);
    }
    if (level + 1 < int(config_.channels.size())) {
      const Layer halving = block / "downsamplers.0";
      hidden = halving.shown(convolution(halving / "conv", hidden, 2));
      left_.push_back(hidden);
    }
    return block.shown(std::move(hidden));
  }

  Tensor middle(const Tensor& x) const {
    const Layer block = root_ / "mid_block";
    Tensor hidden = resnet_of(block / "resnets.0", x);
    hidden = transformer_of(block / "attentions.0", hidden, config_.heads.size() - 1);
    return block.shown(resnet_of(block / "resnets.1", hidden));
  }

  /// Each layer sees, beside what comes up, what the way down left last.
  Tensor up(int i, Tensor hidden) {
    const Layer block = root_ / "up_blocks" / i;
    const int level = int(config_.channels.size()) - 1 - i;
    for (int layer = 0; layer <= config_.layers_per_block; ++layer) {
      hidden = resnet_of(block / "resnets" / layer, at::cat({hidden, left_.back()}, 1));
      left_.pop_back();
      if (config_.up_attends[std::size_t(i)])
        hidden = transformer_of(block / "attentions" / layer, hidden, std::size_t(level));
    }
    if (level > 0) hidden = upsample(block / "upsamplers.0", hidden);
    return block.shown(std::move(hidden));
  }

  Layer root_;
  const weights::UNetConfig& config_;
  const Tensor& context_;
  Tensor embedding_;
  std::vector<Tensor> left_;  ///< By the way down, for the way up.
};

}  // namespace

Tensor predict_noise(const Model& model, const weights::UNetConfig& config, const Tensor& latents,
                     const Tensor& timesteps, const Tensor& context) {
  return Call(model, config, timesteps, context).run(latents);
}

}  // namespace engine::diffusion
