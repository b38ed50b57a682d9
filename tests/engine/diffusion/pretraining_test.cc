#include "engine/diffusion/pretraining.h"

#include <ATen/core/Tensor.h>
#include <ATen/ops/empty.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "engine/core/finite.h"
#include "engine/core/rng.h"
#include "engine/diffusion/autoencoder.h"
#include "engine/diffusion/pictures.h"
#include "engine/diffusion/repainter.h"
#include "engine/diffusion/stable_diffusion.h"
#include "tests/engine/weights/samples.h"
#include "tests/support/data.h"

namespace engine::diffusion {
namespace {

weights::Configs small() {
  weights::Configs configs = weights::tiny_configs();
  configs.unet.sample_side = 8;
  configs.autoencoder.scaling_factor = 1;
  return configs;
}

/// Slopes of some colour in some direction: what little there is to know of them is soon learned.
std::vector<scene::Image> slopes(int count, std::uint64_t seed) {
  Rng rng(seed);
  std::vector<scene::Image> pictures;
  for (int k = 0; k < count; ++k) {
    scene::Image picture(16, 16, 3);
    const float angle = rng.uniform(0, 6.28f);
    for (int c = 0; c < 3; ++c) {
      const float level = rng.uniform(0.3f, 0.7f), slope = rng.uniform(-0.3f, 0.3f);
      for (int y = 0; y < 16; ++y)
        for (int x = 0; x < 16; ++x)
          picture.at(x, y, c) =
              level + slope * (std::cos(angle) * (float(x) - 8) + std::sin(angle) * (float(y) - 8)) / 8;
    }
    pictures.push_back(std::move(picture));
  }
  return pictures;
}

Pretraining begun() { return Pretraining::begin(small(), {.prompt = default_prompt, .seed = 4}).value(); }

double error_of(const Pretraining& model, const std::vector<scene::Image>& pictures) {
  double sum = 0;
  for (const scene::Image& picture : pictures) sum -= scene::psnr(model.through_autoencoder(picture).value(), picture);
  return sum / double(pictures.size());
}

/// Some steps of both networks.
Pretraining trained(int steps) {
  Pretraining model = begun();
  for (int step = 0; step < steps; ++step)
    EXPECT_TRUE(model.autoencoder_step(slopes(4, 100 + std::uint64_t(step)), 1e-2));
  EXPECT_TRUE(model.scale_latents(slopes(8, 1)));
  for (int step = 0; step < steps; ++step) EXPECT_TRUE(model.unet_step(slopes(4, 200 + std::uint64_t(step)), 1e-2));
  return model;
}

TEST(Pretraining, TwentyStepsGiveUnseenPicturesBackBetter) {
  Pretraining model = begun();
  const auto unseen = slopes(4, 9);
  const double before = error_of(model, unseen);
  for (int step = 0; step < 20; ++step) ASSERT_TRUE(model.autoencoder_step(slopes(4, 100 + std::uint64_t(step)), 1e-2));
  EXPECT_LT(error_of(model, unseen), before - 3) << "dB";
}

TEST(Pretraining, TwentyStepsSeeNoiseInUnseenPictures) {
  Pretraining model = begun();
  ASSERT_TRUE(model.scale_latents(slopes(8, 1)));
  const auto unseen = slopes(8, 9);
  const double before = model.unet_loss(unseen, 1).value();
  EXPECT_NEAR(before, 1, 0.1) << "it begins with no noise seen at all";
  for (int step = 0; step < 20; ++step) ASSERT_TRUE(model.unet_step(slopes(4, 200 + std::uint64_t(step)), 1e-2));
  EXPECT_LT(model.unet_loss(unseen, 1).value(), 0.95 * before);
}

TEST(Pretraining, LatentsOfOnePictureAreDrawnAroundItsMeans) {
  const weights::AutoencoderConfig config{.scaling_factor = 1};
  // At the least variance: of means 7, only sevens are drawn. Means of one picture are contiguous within its moments.
  Tensor moments = at::empty({1, 8, 2, 3}, at::kFloat);
  for (float& value : numbers_of(moments)) value = -30;
  for (float& value : numbers_of(moments).first(24)) value = 7;
  Rng rng(1);
  Tensor latents = sample_latents(config, moments, rng);
  for (const float value : numbers_of(latents)) EXPECT_NEAR(value, 7, 1e-4);
  for (const float value : numbers_of(moments).first(24)) EXPECT_EQ(value, 7);
}

TEST(Pretraining, WhatIsNotFiniteIsNamedAndTakesNoStep) {
  auto poisoned = slopes(1, 1);
  poisoned.front().data[5] = std::nanf("");
  Pretraining model = begun(), other = begun();
  const auto step = model.autoencoder_step(poisoned, 1e-2);
  ASSERT_FALSE(step);
  EXPECT_EQ(step.error().where, "pretraining");
  const auto scaled = model.scale_latents(poisoned);
  ASSERT_FALSE(scaled);
  EXPECT_NE(scaled.error().message.find("not finite"), std::string::npos) << scaled.error().message;
  ASSERT_FALSE(model.unet_step(poisoned, 1e-2));
  const auto good = slopes(4, 2);
  EXPECT_EQ(model.autoencoder_step(good, 1e-2)->absolute, other.autoencoder_step(good, 1e-2)->absolute);
  EXPECT_EQ(model.unet_step(good, 1e-2).value(), other.unet_step(good, 1e-2).value()) << "of the same noise";
}

TEST(Pretraining, LatentsOfScaledPicturesHaveUnitVariance) {
  Pretraining model = begun();
  const auto pictures = slopes(8, 1);
  const double factor = model.scale_latents(pictures).value();
  EXPECT_EQ(model.configs().autoencoder.scaling_factor, factor);
  EXPECT_NEAR(model.scale_latents(pictures).value(), factor, 1e-9) << "it is measured on what is not scaled";
}

TEST(Pretraining, WhatIsWrittenOpensAndRepaints) {
  const support::TempDir folder;
  const Pretraining model = trained(3);
  ASSERT_TRUE(model.write(folder.path()));
  const auto opened = StableDiffusion::open(folder.path());
  ASSERT_TRUE(opened) << opened.error().message << " " << opened.error().where;
  const weights::Configs &was = model.configs(), &is = opened->configs();
  EXPECT_EQ(is.unet.channels, was.unet.channels);
  EXPECT_EQ(is.unet.heads, was.unet.heads);
  EXPECT_EQ(is.unet.down_attends, was.unet.down_attends);
  EXPECT_EQ(is.unet.up_attends, was.unet.up_attends);
  EXPECT_EQ(is.unet.sample_side, was.unet.sample_side);
  EXPECT_EQ(is.autoencoder.channels, was.autoencoder.channels);
  EXPECT_EQ(is.autoencoder.layers_per_block, was.autoencoder.layers_per_block);
  EXPECT_EQ(is.autoencoder.scaling_factor, was.autoencoder.scaling_factor);
  EXPECT_EQ(is.noise.beta_end, was.noise.beta_end);
  EXPECT_EQ(is.noise.ends_without_noise, was.noise.ends_without_noise);
  const auto painted = opened->repaint(
      slopes(1, 5).front(), {.prompt = default_prompt, .guidance = 2, .sampling = {Sampler::dpmpp2m, 4, 0.75}});
  ASSERT_TRUE(painted) << painted.error().message;
  EXPECT_FALSE(first_not_finite(painted->data));
}

TEST(Pretraining, SameSeedSameBytes) {
  const support::TempDir one, other;
  ASSERT_TRUE(trained(2).write(one.path()));
  ASSERT_TRUE(trained(2).write(other.path()));
  for (const char* file : {"unet/diffusion_pytorch_model.safetensors", "vae/diffusion_pytorch_model.safetensors",
                           "text_encoder/model.safetensors", "vae/config.json", "tokenizer/vocab.json"})
    EXPECT_TRUE(support::read_file(one.path() / file) == support::read_file(other.path() / file)) << file;
}

TEST(Pretraining, RefusesATextEncoderWithFewerPiecesThanTheTokenizer) {
  weights::Configs configs = small();
  configs.text_encoder.vocabulary = 500;
  const auto model = Pretraining::begin(configs, {});
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(model.error().where, "text_encoder");
}

}  // namespace
}  // namespace engine::diffusion
