#include "engine/diffusion/text_encoder.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/ops/embedding.h>
#include <ATen/ops/full.h>
#include <ATen/ops/gelu.h>

#include <limits>

namespace engine::diffusion {
namespace {

Tensor activated(const Tensor& x, weights::Activation activation) {
  return activation == weights::Activation::gelu ? at::gelu(x) : x * (x * 1.702).sigmoid();
}

}  // namespace

Tensor encode_text(const Model& model, const weights::TextEncoderConfig& config, const Tensor& pieces) {
  const Layer text = Layer(model) / "text_model", embeddings = text / "embeddings";
  const std::int64_t length = pieces.size(1);
  Tensor hidden = embeddings.shown(at::embedding((embeddings / "token_embedding").tensor("weight"), pieces) +
                                   (embeddings / "position_embedding").tensor("weight").narrow(0, 0, length));
  const Tensor ahead = at::full({length, length}, -std::numeric_limits<float>::infinity(), hidden.options()).triu(1);
  for (int i = 0; i < config.layers; ++i) {
    const Layer layer = text / "encoder.layers" / i, attending = layer / "self_attn";
    const Tensor normed = layer_norm(layer / "layer_norm1", hidden, config.norm_eps);
    const Tensor seen = attention(linear(attending / "q_proj", normed), linear(attending / "k_proj", normed),
                                  linear(attending / "v_proj", normed), config.heads, ahead);
    hidden = hidden + linear(attending / "out_proj", seen);
    const Tensor again = layer_norm(layer / "layer_norm2", hidden, config.norm_eps);
    hidden = hidden + linear(layer / "mlp.fc2", activated(linear(layer / "mlp.fc1", again), config.activation));
    hidden = layer.shown(hidden);
  }
  return layer_norm(text / "final_layer_norm", hidden, config.norm_eps);
}

}  // namespace engine::diffusion
