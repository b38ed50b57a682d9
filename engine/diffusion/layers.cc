#include "engine/diffusion/layers.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/ops/bmm.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/conv2d.h>
#include <ATen/ops/group_norm.h>
#include <ATen/ops/layer_norm.h>
#include <ATen/ops/linear.h>
#include <ATen/ops/silu.h>
#include <ATen/ops/upsample_nearest2d.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace engine::diffusion {
namespace {

constexpr std::int64_t max_products = std::int64_t{1} << 25;  // floats: 128 MB, and as much for their softmax

/// [B, n, heads d] to [B heads, n, d].
Tensor by_heads(const Tensor& x, int heads) {
  const std::int64_t batch = x.size(0), length = x.size(1), width = x.size(2) / heads;
  return x.reshape({batch, length, heads, width}).permute({0, 2, 1, 3}).reshape({batch * heads, length, width});
}

Tensor bias_of(const Layer& layer) { return layer.has("bias") ? layer.tensor("bias") : Tensor(); }

}  // namespace

Tensor Layer::shown(Tensor out) const {
  if (model_->probe) model_->probe(name_, out);
  return out;
}

Tensor linear(const Layer& layer, const Tensor& x) {
  Tensor out = at::linear(x, layer.tensor("weight"), bias_of(layer));
  for (const Adapter& adapter : layer.adapters())
    if (adapter.adapts(layer.name())) out = out + adapter.of_linear(layer.name(), x);
  return layer.shown(std::move(out));
}

Tensor convolution(const Layer& layer, const Tensor& x, int stride, int padding) {
  const std::array<std::int64_t, 2> strides{stride, stride}, paddings{padding, padding};
  Tensor out = at::conv2d(x, layer.tensor("weight"), bias_of(layer), strides, paddings);
  for (const Adapter& adapter : layer.adapters())
    if (adapter.adapts(layer.name())) out = out + adapter.of_convolution(layer.name(), x, stride, padding);
  return layer.shown(std::move(out));
}

Tensor group_norm(const Layer& layer, const Tensor& x, int groups, double eps) {
  return layer.shown(at::group_norm(x, groups, layer.tensor("weight"), layer.tensor("bias"), eps));
}

Tensor layer_norm(const Layer& layer, const Tensor& x, double eps) {
  return layer.shown(
      at::layer_norm(x, x.sizes().slice(x.dim() - 1), layer.tensor("weight"), layer.tensor("bias"), eps));
}

Tensor attention(const Tensor& q, const Tensor& k, const Tensor& v, int heads, const Tensor& mask) {
  const std::int64_t batch = q.size(0), queries = q.size(1), width = q.size(2);
  const std::int64_t head_width = width / heads;
  const double scale = 1 / std::sqrt(double(head_width));
  const Tensor scaled = by_heads(q, heads) * scale;
  const Tensor keys = by_heads(k, heads).transpose(1, 2), values = by_heads(v, heads);
  const std::int64_t slice = std::max<std::int64_t>(1, max_products / (batch * heads * k.size(1)));
  std::vector<Tensor> parts;
  for (std::int64_t from = 0; from < queries; from += slice) {
    const std::int64_t length = std::min(slice, queries - from);
    // Not baddbmm(), which lets what lay in its uninitialised output through (libtorch 1.13 on small matrices).
    Tensor products = at::bmm(scaled.narrow(1, from, length), keys);
    if (mask.defined()) products = products + mask.narrow(0, from, length);
    parts.push_back(at::bmm(products.softmax(-1), values));
  }
  const Tensor out = parts.size() == 1 ? parts.front() : at::cat(parts, 1);
  return out.reshape({batch, heads, queries, head_width}).permute({0, 2, 1, 3}).reshape({batch, queries, width});
}

Tensor resnet(const Layer& layer, const Tensor& x, const Tensor* embedding, int groups, double eps) {
  layer.begin_block();
  Tensor hidden = convolution(layer / "conv1", at::silu(group_norm(layer / "norm1", x, groups, eps)));
  if (embedding != nullptr)
    hidden = hidden + linear(layer / "time_emb_proj", at::silu(*embedding)).unsqueeze(-1).unsqueeze(-1);
  hidden = convolution(layer / "conv2", at::silu(group_norm(layer / "norm2", hidden, groups, eps)));
  const Layer shortcut = layer / "conv_shortcut";
  return layer.shown(hidden + (shortcut.has("weight") ? convolution(shortcut, x, 1, 0) : x));
}

Tensor upsample(const Layer& layer, const Tensor& x) {
  layer.begin_block();
  const std::array<std::int64_t, 2> size{2 * x.size(2), 2 * x.size(3)};
  return layer.shown(convolution(layer / "conv", at::upsample_nearest2d(x, size)));
}

}  // namespace engine::diffusion
