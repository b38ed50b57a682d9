#include "engine/diffusion/stable_diffusion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "engine/core/rng.h"
#include "tests/engine/diffusion/tiny_folder.h"

namespace engine::diffusion {
namespace {

using weights::Network;

scene::Image picture() {
  scene::Image image(16, 8, 3);
  Rng rng(5);
  for (float& value : image.data) value = rng.uniform();
  return image;
}

const RepaintOptions few_steps = {.prompt = "a hat", .guidance = 2, .sampling = {.steps = 3}};

TEST(StableDiffusion, ThroughTheAutoencoderThereIsNoChance) {
  const TinyFolder folder;
  const StableDiffusion sd = StableDiffusion::open(folder.path()).value();
  const auto back = sd.through_autoencoder(picture());
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->width, 16);
  EXPECT_EQ(back->height, 8);
  EXPECT_EQ(*back, sd.through_autoencoder(picture()).value());
  EXPECT_FALSE(sd.through_autoencoder(scene::Image(15, 8, 3))) << "not a multiple of 8";
}

TEST(StableDiffusion, RepaintsWithEverySampler) {
  const TinyFolder folder;
  const auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd) << sd.error().message << " " << sd.error().where;
  EXPECT_EQ(sd->side_multiple(), 8);
  for (const auto& [sampler, name] : names<Sampler>) {
    RepaintOptions options = few_steps;
    options.sampling.sampler = sampler;
    const auto repainted = sd->repaint(picture(), options);
    ASSERT_TRUE(repainted) << name << repainted.error().message;
    EXPECT_EQ(repainted->width, 16);
    EXPECT_EQ(repainted->height, 8);
    for (const float value : repainted->data) ASSERT_TRUE(value >= 0 && value <= 1) << name;
    EXPECT_EQ(*repainted, sd->repaint(picture(), options).value()) << name << ": same seed, same bytes";
    options.seed = 1;
    EXPECT_NE(*repainted, sd->repaint(picture(), options).value()) << name;
  }
}

TEST(StableDiffusion, ThePromptMattersAndSoDoesWhatIsNotWanted) {
  const TinyFolder folder;
  const auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd);
  RepaintOptions options = few_steps;
  const scene::Image hat = sd->repaint(picture(), options).value();
  options.prompt = "a cat";
  EXPECT_NE(sd->repaint(picture(), options).value(), hat);
  options = few_steps;
  options.negative_prompt = "a cat";
  EXPECT_NE(sd->repaint(picture(), options).value(), hat);
  options.guidance = 1;
  const scene::Image alone = sd->repaint(picture(), options).value();
  options.negative_prompt = "";
  EXPECT_EQ(sd->repaint(picture(), options).value(), alone) << "without guidance nobody asks what is not wanted";
}

TEST(StableDiffusion, WithoutAStepThePictureStays) {
  const TinyFolder folder;
  const auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd);
  RepaintOptions options = few_steps;
  options.sampling.strength = 0.1;
  EXPECT_EQ(sd->repaint(picture(), options).value(), picture());
}

TEST(StableDiffusion, AnAdapterIsPutOnAndTakenOff) {
  const TinyFolder folder;
  auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd);
  const auto plain = *sd;
  weights::AdapterWeights weights;
  weights.unet["mid_block.attentions.0.transformer_blocks.0.attn1.to_q"] = {
      {{1, 8}, std::vector<float>(8, 1.0f)}, {{8, 1}, {1, -1, 2, -2, 3, -3, 4, -4}}, 1.0};
  ASSERT_TRUE(sd->adapt(weights));
  const scene::Image without = plain.repaint(picture(), few_steps).value();
  EXPECT_NE(sd->repaint(picture(), few_steps).value(), without);
  // What cannot be put on leaves the one that is there.
  const scene::Image with = sd->repaint(picture(), few_steps).value();
  weights::AdapterWeights other = weights;
  other.unet["nowhere"] = weights.unet.begin()->second;
  EXPECT_EQ(sd->adapt(other).error().where, "nowhere");
  other = weights;
  other.unet.begin()->second.up.values.pop_back();
  EXPECT_EQ(sd->adapt(other).error().where, weights.unet.begin()->first);
  EXPECT_EQ(sd->adapt(weights, std::nan("")).error().where, "factor");
  EXPECT_EQ(sd->repaint(picture(), few_steps).value(), with);
  ASSERT_TRUE(sd->adapt({}));
  EXPECT_EQ(sd->repaint(picture(), few_steps).value(), without);
}

TEST(StableDiffusion, AnAdapterThatStaysPaintsBesideTheOneThatIsPutOn) {
  const TinyFolder folder;
  const auto plain = StableDiffusion::open(folder.path());
  ASSERT_TRUE(plain);
  const auto adapter_of = [](const char* layer) {
    weights::AdapterWeights weights;
    weights.unet[layer] = {{{1, 8}, std::vector<float>(8, 1.0f)}, {{8, 1}, {1, -1, 2, -2, 3, -3, 4, -4}}, 1.0};
    return weights;
  };
  const auto queries = adapter_of("mid_block.attentions.0.transformer_blocks.0.attn1.to_q");
  const auto values = adapter_of("mid_block.attentions.0.transformer_blocks.0.attn1.to_v");
  auto staying = plain->with(queries);
  ASSERT_TRUE(staying) << staying.error().message;
  EXPECT_NE(staying->digest(), plain->digest());
  EXPECT_NE(staying->digest(), plain->with(values).value().digest());
  auto put_on = *plain;
  ASSERT_TRUE(put_on.adapt(queries));
  EXPECT_EQ(put_on.digest(), plain->digest());
  const scene::Image with_queries = put_on.repaint(picture(), few_steps).value();
  EXPECT_EQ(staying->repaint(picture(), few_steps).value(), with_queries);

  weights::AdapterWeights both = queries;
  both.unet.insert(values.unet.begin(), values.unet.end());
  ASSERT_TRUE(put_on.adapt(both));
  ASSERT_TRUE(staying->adapt(values));
  EXPECT_EQ(staying->repaint(picture(), few_steps).value(), put_on.repaint(picture(), few_steps).value());
  EXPECT_NE(staying->repaint(picture(), few_steps).value(), with_queries);
  // On the same layer they add up.
  ASSERT_TRUE(staying->adapt(queries));
  ASSERT_TRUE(put_on.adapt(queries, 2));
  const scene::Image sum = staying->repaint(picture(), few_steps).value(),
                     twice = put_on.repaint(picture(), few_steps).value();
  for (std::size_t i = 0; i < sum.data.size(); ++i) ASSERT_NEAR(sum.data[i], twice.data[i], 1e-4) << i;
  ASSERT_TRUE(staying->adapt({}));
  EXPECT_EQ(staying->repaint(picture(), few_steps).value(), with_queries) << "it stays";
  EXPECT_EQ(plain->with(adapter_of("nowhere")).error().where, "nowhere");
}

TEST(StableDiffusion, WhatIsNotFiniteNeverBecomesAPicture) {
  const TinyFolder folder;
  const auto error = [&] {
    const auto sd = StableDiffusion::open(folder.path());
    const auto repainted = sd.value().repaint(picture(), few_steps);
    return repainted ? Error{ErrorCode::internal, "accepted", {}} : repainted.error();
  };
  const auto with_great = [&](Network network, const std::string& name, const std::string& file) {
    auto tensors = weights::random_tensors(weights::tiny_configs(), network, 3);
    for (float& value : tensors.at(name).values) value = 3e38f;
    folder.write(file, weights::encode_tensors(tensors));
  };
  with_great(Network::autoencoder, "decoder.conv_out.weight", "vae/diffusion_pytorch_model.safetensors");
  EXPECT_EQ(error().where, "autoencoder");
  EXPECT_EQ(error().code, ErrorCode::internal);
  with_great(Network::unet, "conv_out.weight", "unet/diffusion_pytorch_model.safetensors");
  EXPECT_EQ(error().where, "latents");
}

TEST(StableDiffusion, TellsHowFarItIsBeforeEachCallAndIsCancelledThere) {
  const TinyFolder folder;
  const auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd);
  std::vector<double> told;  // but for what was told before, within a call
  const auto listen = [&](double part) {
    if (told.empty() || told.back() != part) told.push_back(part);
    return Result<void>{};
  };
  ASSERT_TRUE(sd->repaint(picture(), few_steps, listen));
  ASSERT_EQ(told.size(), 5u) << "encoder, three calls of the UNet, decoder";
  for (std::size_t k = 0; k < told.size(); ++k) EXPECT_NEAR(told[k], double(k) / 5, 1e-12);
  for (int calls = 1; calls <= 5; ++calls) {
    int left = calls;
    const auto repainted = sd->repaint(picture(), few_steps, [&](double) -> Result<void> {
      if (--left > 0) return {};
      return fail(ErrorCode::cancelled, "enough");
    });
    ASSERT_FALSE(repainted);
    EXPECT_EQ(repainted.error().code, ErrorCode::cancelled);
    EXPECT_EQ(left, 0) << "nothing is asked after it";
  }
}

TEST(StableDiffusion, WhatCannotBeRepaintedIsNamed) {
  const TinyFolder folder;
  const auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd);
  const auto where = [&](const scene::Image& image, const RepaintOptions& options) {
    const auto repainted = sd->repaint(image, options);
    return repainted ? "accepted" : repainted.error().where;
  };
  EXPECT_EQ(where(scene::Image(16, 12, 3), few_steps), "picture");
  EXPECT_EQ(where(scene::Image(16, 8, 1), few_steps), "picture");
  EXPECT_EQ(where({}, few_steps), "picture");
  EXPECT_EQ(where(picture(), {.guidance = 0.5}), "guidance");
  EXPECT_EQ(where(picture(), {.sampling = {.steps = 0}}), "steps");
  EXPECT_EQ(where(picture(), {.guidance = 101}), "guidance");
  EXPECT_EQ(where(picture(), {.prompt = "\xff"}), "prompt");
  EXPECT_EQ(where(picture(), {.negative_prompt = "\xff"}), "negative_prompt");
  scene::Image poisoned = picture();
  poisoned.data[7] = std::nanf("");
  EXPECT_EQ(where(poisoned, few_steps), "picture[7]");
  const auto large = sd->repaint(scene::Image(1024, 1032, 3), few_steps);
  ASSERT_FALSE(large);
  EXPECT_EQ(large.error().code, ErrorCode::too_large);
}

TEST(StableDiffusion, ACheckpointWhoseStepsBeginBeyondTrainingIsNamed) {
  const TinyFolder folder;
  folder.write("scheduler/scheduler_config.json",
               R"({"beta_schedule":"scaled_linear","beta_start":0.00085,"beta_end":0.012,"steps_offset":999})");
  const auto sd = StableDiffusion::open(folder.path());
  ASSERT_TRUE(sd);
  const auto repainted = sd->repaint(picture(), few_steps);
  ASSERT_FALSE(repainted);
  EXPECT_EQ(repainted.error().where, "steps_offset");
}

TEST(StableDiffusion, ADamagedCheckpointIsNamed) {
  const TinyFolder folder;
  const auto where = [&] {
    const auto sd = StableDiffusion::open(folder.path());
    return sd ? "accepted" : sd.error().where;
  };
  auto tensors = weights::random_tensors(weights::tiny_configs(), Network::unet, 3);
  tensors.at("mid_block.resnets.0.conv1.bias").values[5] = std::numeric_limits<float>::infinity();
  folder.write("unet/diffusion_pytorch_model.safetensors", weights::encode_tensors(tensors));
  EXPECT_EQ(where(), "diffusion_pytorch_model.safetensors:mid_block.resnets.0.conv1.bias[5]");
  tensors.erase("mid_block.resnets.0.conv1.bias");
  folder.write("unet/diffusion_pytorch_model.safetensors", weights::encode_tensors(tensors));
  EXPECT_EQ(where(), "diffusion_pytorch_model.safetensors:mid_block.resnets.0.conv1.bias");
  folder.write("tokenizer/vocab.json", R"({"<|startoftext|>":0,"<|endoftext|>":520})");
  EXPECT_EQ(where(), "vocab.json:<|endoftext|>");
}

}  // namespace
}  // namespace engine::diffusion
