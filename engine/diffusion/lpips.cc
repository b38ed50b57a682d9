#include "engine/diffusion/lpips.h"

#include <ATen/Parallel.h>
#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/conv2d.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/max_pool2d.h>
#include <ATen/ops/relu.h>
#include <ATen/ops/replication_pad2d.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/finite.h"
#include "engine/diffusion/guard.h"
#include "engine/diffusion/tensor.h"

namespace engine::diffusion {
namespace {

constexpr int least_side = 16;  // four times halved, one pixel is left
constexpr std::size_t depths = weights::lpips_depths;

// What pictures in -1 to 1 are shifted and divided by, channel by channel (version 0.1).
constexpr std::array<float, 3> shift = {-0.030f, -0.088f, -0.188f}, divisor = {0.458f, 0.448f, 0.450f};

/// A tensor of a file that was checked.
Result<Tensor> read(const weights::TensorFile& file, const weights::TensorSpec& spec) {
  Tensor tensor = at::empty(spec.shape, at::kFloat);
  const auto done = weights::read_floats(*file.find(spec.name), file.name() + ":" + spec.name,
                                         {tensor.data_ptr<float>(), std::size_t(tensor.numel())});
  if (!done) return propagate(done);
  return tensor;
}

/// [1, 3, H, W], as the network was trained with them, of a picture in -1 to 1.
Tensor as_input(const scene::Image& picture) {
  Tensor tensor = at::empty({1, 3, picture.height, picture.width}, at::kFloat);
  float* out = tensor.data_ptr<float>();
  for (int c = 0; c < 3; ++c)
    for (const float value : picture.plane(c)) *out++ = (value - shift[std::size_t(c)]) / divisor[std::size_t(c)];
  return tensor;
}

Tensor drawn_out(const Tensor& input) {
  const std::int64_t below = std::max<std::int64_t>(0, least_side - input.size(2));
  const std::int64_t beside = std::max<std::int64_t>(0, least_side - input.size(3));
  if (below == 0 && beside == 0) return input;
  const std::array<std::int64_t, 4> border{0, beside, 0, below};
  return at::replication_pad2d(input, border);
}

/// Features of length 1 at each place.
Tensor of_unit_length(const Tensor& features) {
  constexpr double never_zero = 1e-10, least_square = 1e-30;  // below it the square root's slope is not followed
  return features / ((features * features).sum(1, true).clamp_min(least_square).sqrt() + never_zero);
}

}  // namespace

struct Lpips::Network {
  struct Layer {
    Tensor weight, bias;
  };
  std::vector<Layer> layers;
  std::vector<Tensor> linear;  ///< [1, C, 1, 1] of each depth.

  /// Of each depth, of unit length.
  ///   ask  called before each convolution, on the way back as well, which what it refers to must outlive
  [[nodiscard]] std::vector<Tensor> features(const Tensor& input, const std::function<void()>& ask) const {
    std::vector<Tensor> all;
    Tensor hidden = drawn_out(input);
    for (std::size_t i = 0; i < layers.size(); ++i) {
      ask();
      hidden = at::relu(at::conv2d(hidden, layers[i].weight, layers[i].bias, 1, 1));
      if (hidden.requires_grad()) hidden.register_hook([ask](const Tensor&) { ask(); });
      if (!weights::vgg_convolutions[i].ends_depth) continue;
      all.push_back(of_unit_length(hidden));
      if (all.size() < depths) hidden = at::max_pool2d(hidden, 2, 2);
    }
    return all;
  }
};

Lpips::Lpips(std::unique_ptr<const Network> network, std::string digest, int threads)
    : network_(std::move(network)), digest_(std::move(digest)), threads_(threads) {}
Lpips::~Lpips() = default;

Result<std::unique_ptr<Lpips>> Lpips::create(const weights::LpipsFiles& files, int threads) {
  if (const auto checked = files.check(); !checked) return propagate(checked);
  return guarded(files.vgg16.name(), [&]() -> Result<std::unique_ptr<Lpips>> {
    auto network = std::make_unique<Network>();
    for (const weights::VggConvolution& convolution : weights::vgg_convolutions) {
      auto weight = read(files.vgg16, weights::vgg_weight(convolution));
      if (!weight) return propagate(weight);
      auto bias = read(files.vgg16, weights::vgg_bias(convolution));
      if (!bias) return propagate(bias);
      network->layers.push_back({std::move(*weight), std::move(*bias)});
      if (!convolution.ends_depth) continue;
      auto weighting = read(files.linear, weights::lpips_weight(network->linear.size(), convolution.out));
      if (!weighting) return propagate(weighting);
      network->linear.push_back(std::move(*weighting));
    }
    return std::unique_ptr<Lpips>(new Lpips(std::move(network), files.digest(), threads));
  });
}

Result<double> Lpips::evaluate(const scene::Image& rendered, const scene::Image& target, scene::Image& v_rendered) {
  const auto from_minus_one = [](scene::Image picture) {
    for (float& value : picture.data) value = 2 * value - 1;
    return picture;
  };
  const auto value = evaluate_signed(from_minus_one(rendered), from_minus_one(target), v_rendered);
  if (value)
    for (float& v : v_rendered.data) v *= 2;
  return value;
}

Result<double> Lpips::evaluate_signed(const scene::Image& rendered, const scene::Image& target,
                                      scene::Image& v_rendered) {
  if (rendered.width != target.width || rendered.height != target.height || rendered.channels != 3 ||
      target.channels != 3 || rendered.pixels() == 0)
    return fail(ErrorCode::invalid_argument, "expected two pictures of one size and three channels", "rendered");
  return guarded("lpips", [&]() -> Result<double> {
    if (threads_ > 0) at::set_num_threads(threads_);
    const auto ask = [this] {
      if (auto going = going_on(); !going) throw Ended(going.error());
    };
    std::vector<Tensor> of_target;
    {
      const at::NoGradGuard no_gradients;
      of_target = network_->features(as_input(target), ask);
    }
    const at::AutoGradMode gradients(true);
    Tensor input = as_input(rendered);
    input.requires_grad_();
    const std::vector<Tensor> of_rendered = network_->features(input, ask);
    Tensor sum;
    for (std::size_t depth = 0; depth < depths; ++depth) {
      const Tensor difference = of_rendered[depth] - of_target[depth];
      // The weighted sum over channels, and its mean over places.
      const Tensor share = (difference * difference * network_->linear[depth]).sum(1).mean();
      shares_[depth] = share.item<double>();
      sum = depth == 0 ? share : sum + share;
    }
    sum.backward();
    v_rendered = scene::Image(rendered.width, rendered.height, 3);
    const Tensor gradient = input.grad().contiguous();
    const float* from = gradient.data_ptr<float>();
    for (int c = 0; c < 3; ++c)
      for (float& value : v_rendered.plane(c)) value = *from++ / divisor[std::size_t(c)];
    double value = 0;
    for (const double share : shares_) value += share;
    // A poisoned gradient must not reach the scene.
    if (!std::isfinite(value) || first_not_finite(v_rendered.data))
      return fail(ErrorCode::internal, "the perceptual distance of two pictures, or its gradient, is not finite",
                  "lpips");
    return value;
  });
}

}  // namespace engine::diffusion
