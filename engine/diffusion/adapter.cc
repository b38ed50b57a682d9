#include "engine/diffusion/adapter.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/ops/conv2d.h>
#include <ATen/ops/linear.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "engine/core/rng.h"
#include "engine/diffusion/numbers.h"

namespace engine::diffusion {
struct Adapter::Pairs {
  struct Pair {
    Tensor down, up;
    double scale = 1;
  };
  std::map<std::string, Pair> by_layer;
};

Adapter::Adapter(const Layers& layers) : pairs_(std::make_shared<Pairs>()) {
  for (const auto& [layer, pair] : layers)
    pairs_->by_layer.emplace(layer, Pairs::Pair{tensor_of(pair.down), tensor_of(pair.up), pair.scale});
}

Adapter Adapter::fresh(const std::vector<weights::TensorSpec>& network, const std::vector<std::string>& targets,
                       int rank, double alpha, std::uint64_t seed) {
  constexpr std::string_view ending = ".weight";
  Layers layers;
  std::uint64_t stream = 0;
  for (const weights::TensorSpec& spec : network) {
    if (!spec.name.ends_with(ending) || spec.shape.size() < 2) continue;
    const std::string layer = spec.name.substr(0, spec.name.size() - ending.size());
    if (std::ranges::none_of(targets, [&](const std::string& target) { return layer.ends_with("." + target); }))
      continue;
    weights::LowRank pair{{spec.shape, {}}, {{spec.shape[0], rank}, {}}, alpha / rank};
    pair.down.shape[0] = rank;
    if (spec.shape.size() == 4) pair.up.shape.insert(pair.up.shape.end(), {1, 1});
    std::size_t down = 1;
    for (const std::int64_t size : pair.down.shape) down *= std::size_t(size);
    pair.down.values.resize(down);
    pair.up.values.resize(std::size_t(spec.shape[0]) * std::size_t(rank));
    Rng rng(seed, stream++);
    for (float& value : pair.down.values) value = rng.normal() / float(rank);
    layers.emplace(layer, std::move(pair));
  }
  return Adapter(layers);
}

Adapter::Layers Adapter::layers() const {
  Layers layers;
  for (const auto& [layer, pair] : pairs_->by_layer)
    layers.emplace(layer, weights::LowRank{values_of(pair.down), values_of(pair.up), pair.scale});
  return layers;
}

bool Adapter::adapts(const std::string& layer) const { return pairs_->by_layer.contains(layer); }

void Adapter::scale_by(double factor) {
  for (auto& [layer, pair] : pairs_->by_layer) pair.scale *= factor;
}

Tensor Adapter::of_linear(const std::string& layer, const Tensor& x) const {
  const Pairs::Pair& pair = pairs_->by_layer.at(layer);
  return at::linear(at::linear(x, pair.down), pair.up) * pair.scale;
}

Tensor Adapter::of_convolution(const std::string& layer, const Tensor& x, int stride, int padding) const {
  const Pairs::Pair& pair = pairs_->by_layer.at(layer);
  const std::array<std::int64_t, 2> strides{stride, stride}, paddings{padding, padding};
  return at::conv2d(at::conv2d(x, pair.down, {}, strides, paddings), pair.up) * pair.scale;
}

void Adapter::collect(std::vector<Tensor>& into) const {
  for (auto& [layer, pair] : pairs_->by_layer)
    for (Tensor* tensor : {&pair.down, &pair.up}) into.push_back(tensor->requires_grad_());
}

}  // namespace engine::diffusion
