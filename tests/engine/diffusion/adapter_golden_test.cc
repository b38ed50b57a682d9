// Adapters of low rank against the reference: what they add, and twenty steps of training.
#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/full.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/stack.h>
#include <gtest/gtest.h>

#include "engine/diffusion/text_encoder.h"
#include "engine/diffusion/training.h"
#include "engine/diffusion/unet.h"
#include "engine/weights/adapter_file.h"
#include "tests/engine/diffusion/golden.h"

namespace engine::diffusion {
namespace {

weights::FloatTensor float_tensor(const support::Tensor& tensor) {
  return {{tensor.shape.begin(), tensor.shape.end()}, tensor.floats()};
}

/// The layers whose tensors are named PREFIX LAYER .lora_A.weight and .lora_B.weight.
Adapter::Layers layers_of(const support::TensorFile& file, const std::string& prefix, double scale) {
  const std::string ending = ".lora_A.weight";
  Adapter::Layers layers;
  for (const auto& [name, tensor] : file.all()) {
    if (!name.starts_with(prefix) || !name.ends_with(ending)) continue;
    const std::string layer = name.substr(prefix.size(), name.size() - prefix.size() - ending.size());
    layers.emplace(
        layer, weights::LowRank{float_tensor(tensor), float_tensor(file.at(prefix + layer + ".lora_B.weight")), scale});
  }
  return layers;
}

class AdapterGolden : public testing::Test {
 protected:
  void SetUp() override {
    REQUIRE_SHARED(support::golden_dir() / "lora_train.safetensors");
    models.emplace(tiny_models());
  }
  static support::TensorFile golden(const char* name) { return support::TensorFile(support::golden_dir() / name); }

  std::optional<TinyModels> models;
};

TEST_F(AdapterGolden, AddsWhatTheReferenceAddsInEveryLayoutAndScale) {
  const at::NoGradGuard no_gradients;
  const auto file = golden("lora_output.safetensors");
  const Tensor sample = as_tensor(file.at("sample")), context = as_tensor(file.at("encoder_hidden_states"));
  const auto out = [&](int t) {
    return predict_noise(models->unet, models->configs().unet, sample, at::full({2}, t, at::kLong), context);
  };
  const std::map<std::string, std::string> layouts = {{"diffusers_current", "scale1"},
                                                      {"diffusers_legacy_processor", "scale1"},
                                                      {"diffusers_peft_lora_AB", "scale1"},
                                                      {"peft_adapter_model", "scale2"},
                                                      {"kohya_alpha8", "scale2"}};
  for (const int t : {1, 261, 741}) {
    const std::string prefix = "t" + std::to_string(t) + ".";
    models->unet.adapters.clear();
    EXPECT_TRUE(near(out(t), as_tensor(file.at(prefix + "base")), 2e-5));
    for (const auto& [layout, scaled] : layouts) {
      const auto weights =
          weights::read_adapter(support::golden_dir() / "lora" / (layout + ".safetensors"), models->configs());
      ASSERT_TRUE(weights) << weights.error().where;
      Adapter adapter(weights->unet);
      models->unet.adapters = {adapter};
      EXPECT_TRUE(near(out(t), as_tensor(file.at(prefix + scaled)), 2e-5)) << layout;
      if (layout != "diffusers_current") continue;
      EXPECT_TRUE(near(out(t), as_tensor(file.at(prefix + "merged_scale1")), 2e-5));
      adapter.scale_by(0.5);
      EXPECT_TRUE(near(out(t), as_tensor(file.at(prefix + "scale0.5")), 2e-5));
      adapter.scale_by(4);
      EXPECT_TRUE(near(out(t), as_tensor(file.at(prefix + "scale2")), 2e-5));
    }
  }
}

TEST_F(AdapterGolden, MergedWeightsAreTheSumOfBoth) {
  const auto file = golden("lora_output.safetensors");
  const auto weights =
      weights::read_adapter(support::golden_dir() / "lora/diffusers_current.safetensors", models->configs());
  ASSERT_TRUE(weights);
  for (const std::string layer : {"down_blocks.0.attentions.0.transformer_blocks.0.attn1.to_k",
                                  "up_blocks.3.attentions.2.transformer_blocks.0.attn2.to_v"}) {
    // W + s B A, column by column: the layer on the unit vectors.
    const Tensor& weight = models->unet.parameters.at(layer + ".weight");
    const Tensor unit = at::full({weight.size(1)}, 1.0).diag();
    const Tensor merged = weight + Adapter(weights->unet).of_linear(layer, unit).t();
    EXPECT_TRUE(near(merged, as_tensor(file.at("merged_weight_scale1." + layer)), 2e-5)) << layer;
  }
}

/// Twenty steps from one start: "B0" has B = 0, "Bn" has not.
void train(TinyModels& models, const support::TensorFile& file, const std::string& start) {
  const Adapter adapter(layers_of(file, start + ".init.", 1));
  models.unet.adapters = {adapter};
  std::vector<Tensor> trained;
  adapter.collect(trained);
  ASSERT_EQ(trained.size(), 256u);
  AdamW optimiser(trained, {});
  const Tensor latents = as_tensor(file.at("latents")), context = as_tensor(file.at("encoder_hidden_states"));
  const Tensor noise = as_tensor(file.at("noise")), timesteps = as_tensor(file.at("timesteps"));
  const auto compare = [&](const std::string& stage) {
    const auto layers = adapter.layers();
    for (const auto& [layer, expected] : layers_of(file, start + "." + stage + ".", 1)) {
      for (std::size_t i = 0; i < expected.down.values.size(); ++i)
        ASSERT_NEAR(layers.at(layer).down.values[i], expected.down.values[i], 5e-6) << stage << layer;
      for (std::size_t i = 0; i < expected.up.values.size(); ++i)
        ASSERT_NEAR(layers.at(layer).up.values[i], expected.up.values[i], 5e-6) << stage << layer;
    }
  };
  for (std::int64_t step = 0; step < 20; ++step) {
    const Tensor noise_now = noise.select(0, step), times_now = timesteps.select(0, step);
    const NoisyBatch batch{&latents, &noise_now, &times_now, &context};
    if (step == 0) {
      const Tensor noisy = noisy_latents(models.configs().noise, batch);
      EXPECT_TRUE(near(noisy, as_tensor(file.at(start + ".step0.noisy")), 1e-5));
      EXPECT_TRUE(near(predict_noise(models.unet, models.configs().unet, noisy, times_now, context),
                       as_tensor(file.at(start + ".step0.pred")), 2e-5));
    }
    const auto loss = training_step(models.unet, models.configs(), batch, optimiser);
    ASSERT_TRUE(loss) << loss.error().message;
    const double expected = file.at(start + ".loss").values[std::size_t(step)];
    EXPECT_NEAR(*loss, expected, 1e-5 * expected) << "step " << step;
    const double norm = file.at(start + ".grad_norm").values[std::size_t(step)];
    EXPECT_NEAR(optimiser.gradient_norm(), norm, 1e-4 * norm) << "step " << step;
    if (step == 0) {
      std::size_t i = 0;
      for (const auto& [layer, pair] : adapter.layers())
        for (const char* half : {".lora_A.weight", ".lora_B.weight"}) {
          const Tensor gradient = as_tensor(file.at(start + ".grad0." + layer + half));
          const Tensor ours = trained[i++].grad();
          if (largest(gradient) == 0)
            EXPECT_EQ(largest(ours), 0) << layer << half;
          else
            EXPECT_LT(relative_distance(ours, gradient), 1e-4) << layer << half;
        }
      compare("step1");
    }
    if (step == 4 && start == "B0") compare("step5");
    if (step == 19) compare("step20");
  }
}

TEST_F(AdapterGolden, TrainingFromZeroIsTheReferences) { train(*models, golden("lora_train.safetensors"), "B0"); }
TEST_F(AdapterGolden, TrainingFromElsewhereIsTheReferences) { train(*models, golden("lora_train.safetensors"), "Bn"); }

TEST_F(AdapterGolden, OnTheTextEncoderWithGradientsThroughBothNetworks) {
  const auto file = golden("lora_text_encoder.safetensors"), train_file = golden("lora_train.safetensors");
  const Adapter adapter(layers_of(file, "lora.", 2));
  models->text_encoder.adapters = {adapter};
  std::vector<Tensor> trained;
  adapter.collect(trained);
  ASSERT_EQ(trained.size(), 8u);
  const auto expect_gradients = [&](const std::string& prefix) {
    std::size_t i = 0;
    for (const auto& [layer, pair] : adapter.layers())
      for (const char* half : {".lora_A.weight", ".lora_B.weight"})
        EXPECT_LT(relative_distance(trained[i++].grad(), as_tensor(file.at(prefix + layer + half))), 1e-3)
            << prefix << layer << half;
    for (Tensor& tensor : trained) tensor.mutable_grad().reset();
  };
  const auto encoded = [&] {
    return encode_text(models->text_encoder, models->configs().text_encoder, as_tensor(file.at("input_ids")));
  };
  const Tensor out = encoded();
  EXPECT_TRUE(near(out, as_tensor(file.at("last_hidden_state")), 1e-4));
  (out * as_tensor(file.at("upstream"))).sum().backward();
  expect_gradients("grad.");

  const Tensor noise = as_tensor(train_file.at("noise")).select(0, 0);
  const Tensor latents = as_tensor(train_file.at("latents"));
  const Tensor timesteps = as_tensor(train_file.at("timesteps")).select(0, 0), context = encoded();
  const Tensor loss = denoising_loss(models->unet, models->configs(), {&latents, &noise, &timesteps, &context});
  const double expected = file.at("unet_loss").values[0];
  EXPECT_NEAR(loss.item<double>(), expected, 1e-5 * expected);
  loss.backward();
  expect_gradients("unet_loss_grad.");
}

}  // namespace
}  // namespace engine::diffusion
