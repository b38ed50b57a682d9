// The layers that the networks of Stable Diffusion are made of.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "engine/diffusion/adapter.h"
#include "engine/diffusion/parameters.h"
#include "engine/diffusion/tensor.h"

namespace engine::diffusion {

/// Is shown what layers give, by their names.
using Probe = std::function<void(const std::string& layer, const Tensor& out)>;

/// A network as it is used: its tensors, and what is added to them.
struct Model {
  Parameters parameters;
  std::vector<Adapter> adapters = {};  ///< Each adds to what the layers that it adapts make of the same input.
  Probe probe = {};
  /// Called before each block, on the way back as well; what it throws ends the computation. May be empty.
  std::function<void()> before_block = {};
  bool recomputes = true;  ///< In training, transformers are computed again on the way back (recompute.h).
};

/// A layer, or a part of a network, by its name. The model must outlive it, and copies of it that gradients keep until
/// the way back is over.
class Layer {
 public:
  explicit Layer(const Model& model, std::string name = {}) : model_(&model), name_(std::move(name)) {}

  /// A layer within: Layer(model, "mid_block") / "resnets.0".
  [[nodiscard]] Layer operator/(const std::string& part) const {
    return Layer(*model_, name_.empty() ? part : name_ + "." + part);
  }
  [[nodiscard]] Layer operator/(int part) const { return *this / std::to_string(part); }

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const Tensor& tensor(const char* part) const { return model_->parameters.at(name_ + "." + part); }
  [[nodiscard]] bool has(const char* part) const { return model_->parameters.contains(name_ + "." + part); }
  [[nodiscard]] const std::vector<Adapter>& adapters() const { return model_->adapters; }  ///< Of any layer.
  /// A block of the network begins here.
  void begin_block() const {
    if (model_->before_block) model_->before_block();
  }
  [[nodiscard]] bool recomputes() const { return model_->recomputes; }
  /// Shows what this layer gives, and gives it.
  [[nodiscard]] Tensor shown(Tensor out) const;

 private:
  const Model* model_;
  std::string name_;
};

/// W x + b, or W x where the layer has no bias. x is [..., in].
[[nodiscard]] Tensor linear(const Layer& layer, const Tensor& x);
/// x is [B, in, h, w]; the kernel's size is that of the layer's tensor.
[[nodiscard]] Tensor convolution(const Layer& layer, const Tensor& x, int stride = 1, int padding = 1);
[[nodiscard]] Tensor group_norm(const Layer& layer, const Tensor& x, int groups, double eps);  ///< x is [B, C, ...].
[[nodiscard]] Tensor layer_norm(const Layer& layer, const Tensor& x, double eps);              ///< x is [..., C].

/// softmax(q k^T / sqrt(d)) v for each of `heads` parts of width d, in slices of queries so that no more than a quarter
/// of a gigabyte of products is held: those of one slice, and their softmax. With gradients all slices are kept.
///   q, k, v  [B, n, heads d], [B, m, heads d] twice
///   mask     [n, m], added to the products; an undefined tensor is none
[[nodiscard]] Tensor attention(const Tensor& q, const Tensor& k, const Tensor& v, int heads, const Tensor& mask);

/// norm, SiLU, 3 x 3 convolution, twice; the input is added. x is [B, C, h, w].
///   embedding  [B, E], put through SiLU and a matrix and added in between; null: there is none
[[nodiscard]] Tensor resnet(const Layer& layer, const Tensor& x, const Tensor* embedding, int groups, double eps);

/// Twice the size, by repetition, then a 3 x 3 convolution ("conv").
[[nodiscard]] Tensor upsample(const Layer& layer, const Tensor& x);

}  // namespace engine::diffusion
