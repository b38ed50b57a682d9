#include "engine/diffusion/adapter.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/ops/arange.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/full.h>
#include <ATen/ops/randn.h>
#include <gtest/gtest.h>

#include <limits>

#include "engine/diffusion/training.h"
#include "tests/engine/weights/samples.h"

namespace engine::diffusion {
namespace {

weights::FloatTensor ones(const weights::Shape& shape) {
  std::size_t count = 1;
  for (const std::int64_t size : shape) count *= std::size_t(size);
  return {shape, std::vector<float>(count, 1.0f)};
}

TEST(Adapter, AddsItsScaledProduct) {
  const Adapter adapter(
      {{"layer", {ones({2, 3}), ones({4, 2}), 0.5}}, {"conv", {ones({1, 3, 3, 3}), ones({2, 1, 1, 1}), 2}}});
  EXPECT_TRUE(adapter.adapts("layer"));
  EXPECT_FALSE(adapter.adapts("other"));
  const Tensor x = at::full({1, 3}, 2.0);
  EXPECT_TRUE(adapter.of_linear("layer", x).equal(at::full({1, 4}, 0.5 * 2 * 6)));
  const Tensor picture = at::full({1, 3, 4, 4}, 1.0), out = adapter.of_convolution("conv", picture, 2, 1);
  EXPECT_EQ(out.sizes(), (at::IntArrayRef{1, 2, 2, 2}));
  EXPECT_EQ(out.select(1, 0).select(1, 1).select(1, 1).item<float>(), 2.0f * 27);
}

TEST(Adapter, AFreshOneAddsNothingAndIsOfItsSeed) {
  const auto network = weights::tensors_of(weights::tiny_configs().unet);
  const Adapter adapter = Adapter::fresh(network, {"to_q", "to_v"}, 2, 8, 1);
  const auto layers = adapter.layers();
  EXPECT_EQ(layers.size(), 2u * 2 * (4 + 1 + 6)) << "of two projections in two attentions of each transformer";
  for (const auto& [layer, pair] : layers) {
    EXPECT_TRUE(layer.ends_with("to_q") || layer.ends_with("to_v"));
    EXPECT_EQ(pair.rank(), 2);
    EXPECT_EQ(pair.scale, 4);
    for (const float value : pair.up.values) EXPECT_EQ(value, 0);
  }
  const auto again = Adapter::fresh(network, {"to_q", "to_v"}, 2, 8, 1).layers();
  const auto other = Adapter::fresh(network, {"to_q", "to_v"}, 2, 8, 2).layers();
  EXPECT_EQ(layers.begin()->second.down.values, again.begin()->second.down.values);
  EXPECT_NE(layers.begin()->second.down.values, other.begin()->second.down.values);
}

TEST(AdamW, FollowsItsFormulaOnOneNumber) {
  Tensor parameter = at::full({1}, 2.0);
  const AdamWOptions options{.learning_rate = 0.1, .weight_decay = 0.5};
  AdamW optimiser({parameter}, options);
  double expected = 2, mean = 0, square = 0;
  for (int step = 1; step <= 5; ++step) {
    optimiser.clear_gradients();
    (parameter * parameter).sum().backward();
    const double gradient = 2 * expected;
    EXPECT_NEAR(optimiser.gradient_norm(), std::abs(gradient), 1e-5);
    optimiser.step();
    mean = 0.9 * mean + 0.1 * gradient, square = 0.999 * square + 0.001 * gradient * gradient;
    const double of_mean = mean / (1 - std::pow(0.9, step)), of_square = square / (1 - std::pow(0.999, step));
    expected = expected * (1 - 0.1 * 0.5) - 0.1 * of_mean / (std::sqrt(of_square) + 1e-8);
    EXPECT_NEAR(parameter.item<double>(), expected, 1e-5) << step;
  }
}

TEST(AdamW, LeavesWhatHasNoGradient) {
  Tensor parameter = at::full({2}, 3.0);
  AdamW optimiser({parameter}, {});
  optimiser.step();
  EXPECT_TRUE(parameter.equal(at::full({2}, 3.0)));
  EXPECT_EQ(optimiser.gradient_norm(), 0);
}

TEST(AdamW, OptionsAreChecked) {
  EXPECT_TRUE(validate(AdamWOptions{}));
  EXPECT_EQ(validate(AdamWOptions{.learning_rate = 0}).error().where, "learning_rate");
  EXPECT_EQ(validate(AdamWOptions{.beta2 = 1}).error().where, "beta2");
  EXPECT_EQ(validate(AdamWOptions{.weight_decay = -1}).error().where, "weight_decay");
}

/// Networks of a few kilobytes with something to learn.
TEST(Training, LowersTheLossOnWhatItLearnsFromAndRefusesPoison) {
  const weights::Configs configs = weights::tiny_configs();
  auto file = weights::TensorFile::parse(
      weights::bytes_of(weights::encode_tensors(weights::original_tensors(configs, false, 3))), "tiny.safetensors");
  const auto checkpoint = weights::Checkpoint::of_file(std::move(*file), configs);
  ASSERT_TRUE(checkpoint);
  const Adapter adapter =
      Adapter::fresh(weights::tensors_of(configs.unet), {"to_q", "to_k", "to_v", "to_out.0"}, 2, 8, 1);
  const Model unet{Parameters::load(*checkpoint, weights::Network::unet).value(), {adapter}};
  Tensor latents = at::empty({2, 4, 8, 8}), noise = at::empty({2, 4, 8, 8}), context = at::empty({2, 77, 6});
  std::uint64_t stream = 0;
  for (Tensor* tensor : {&latents, &noise, &context}) {
    Rng rng(9, stream++);
    for (std::int64_t i = 0; i < tensor->numel(); ++i) tensor->data_ptr<float>()[i] = rng.normal();
  }
  const Tensor timesteps = at::arange(300, 500, 100, at::kLong);
  std::vector<Tensor> trained;
  adapter.collect(trained);
  AdamW optimiser(trained, {.learning_rate = 1e-2});
  const NoisyBatch batch{&latents, &noise, &timesteps, &context};
  double first = 0, last = 0;
  for (int step = 0; step < 60; ++step) {
    const auto loss = training_step(unet, configs, batch, optimiser);
    ASSERT_TRUE(loss) << loss.error().message;
    (step == 0 ? first : last) = *loss;
  }
  EXPECT_LT(last, 0.99 * first);

  const auto before = adapter.layers();
  Tensor poisoned = noise.clone();
  poisoned.data_ptr<float>()[3] = std::numeric_limits<float>::infinity();
  const auto refused = training_step(unet, configs, {&latents, &poisoned, &timesteps, &context}, optimiser);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::internal);
  for (const auto& [layer, pair] : adapter.layers()) EXPECT_EQ(pair.down.values, before.at(layer).down.values);
}

}  // namespace
}  // namespace engine::diffusion
